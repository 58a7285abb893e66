"""The kind of processor: two kinds round otherwise, the same kind does not."""

from __future__ import annotations

import platform

import numpy as np  # noqa: F401 - brings the linear algebra that is asked for its kernels
from llvmlite.binding import get_host_cpu_name
from threadpoolctl import threadpool_info


def processor() -> str:
    """What compiled code and linear algebra take this machine for."""
    kernels = {found["architecture"] for found in threadpool_info() if "architecture" in found}
    return ", ".join([platform.system(), platform.machine(), get_host_cpu_name(), *sorted(kernels)])
