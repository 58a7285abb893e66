"""What a study runs with: Python, the installed packages, and the machine."""

from __future__ import annotations

import os
import platform
from importlib.metadata import distributions

from packaging.utils import canonicalize_name


def environment() -> dict:
    """Versions of Python and of all packages, and apart from them what depends on the machine."""
    packages = {canonicalize_name(one.name): one.version for one in distributions() if one.name}
    return {
        "python": platform.python_version(),
        "packages": dict(sorted(packages.items())),
        "machine": {
            "system": platform.system(),
            "release": platform.release(),
            "architecture": platform.machine(),
            "cores": os.cpu_count(),
        },
    }
