"""Check that the lock files can be installed on other systems: check_wheels.py.

uv resolves each lock file for each system and Python from wheels, except for the packages named
here. The exit code is 1 if a lock file cannot be resolved, and 2 if no package index answers.
"""

import subprocess
import sys
import tempfile
from itertools import product
from pathlib import Path

ROOT = Path(__file__).parents[2]
LOCKS = ("requirements.lock", "requirements-dev.lock")
SYSTEMS = {
    "Linux": "x86_64-unknown-linux-gnu",
    "macOS": "aarch64-apple-darwin",
    "Windows": "x86_64-pc-windows-msvc",
}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
# requirements of Snakemake without a wheel: the first is pure Python, the second needs a compiler
BUILT_PACKAGES = {
    "3.11": ["connection-pool"], "3.12": ["connection-pool"], "3.13": ["connection-pool"],
    "3.14": ["connection-pool", "immutables"],
}  # fmt: skip
NETWORK_ERRORS = ("Failed to fetch", "error sending request", "dns error", "Could not connect")


def resolve_lock(lock: Path, system: str, python: str) -> subprocess.CompletedProcess:
    """Test with uv, without installing, whether a lock file resolves for a system and a Python."""
    built = (option for name in BUILT_PACKAGES[python] for option in ("--no-binary", name))
    with tempfile.TemporaryDirectory() as folder:
        return subprocess.run(
            [sys.executable, "-m", "uv", "pip", "install", "--dry-run", "--target", folder,
             "--only-binary", ":all:", *built, "--python-platform", SYSTEMS[system],
             "--python-version", python, "--require-hashes", "--requirements", str(lock)],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip


def main() -> int:
    """Test all lock files on all systems and Pythons, print results, return the exit code."""
    failed = 0
    for lock, system, python in product(LOCKS, SYSTEMS, PYTHONS):
        resolution = resolve_lock(ROOT / lock, system, python)
        packages = sum(line.startswith(" + ") for line in resolution.stdout.splitlines())
        result = f"{packages} packages" if resolution.returncode == 0 else resolution.stdout.strip()
        print(f"{lock} on {system} with Python {python}: {result}", flush=True)
        if any(sign in resolution.stdout for sign in NETWORK_ERRORS):
            return 2
        failed += resolution.returncode != 0
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
