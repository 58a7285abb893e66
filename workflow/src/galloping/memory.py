"""Memory of the process of a command or a job."""

import ctypes
import sys
from contextlib import suppress

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # parameters of glibc's mallopt
MAX_KEPT_ARRAY = 32 * 1024**2  # bytes: freed arrays up to this size are kept for later ones
MAX_KEPT_MEMORY = 128 * 1024**2  # bytes: most freed memory that is kept


def keep_freed_memory() -> None:
    """Keep the memory of freed arrays for later arrays, instead of returning it to the system.

    By default glibc returns it, and each large array costs the system's time to clear its memory
    anew: a tenth of an identification. Nothing changes with other C libraries.
    """
    if sys.platform == "linux":
        with suppress(AttributeError):  # musl has no mallopt
            set_option = ctypes.CDLL(None).mallopt
            set_option(M_MMAP_THRESHOLD, MAX_KEPT_ARRAY)
            set_option(M_TRIM_THRESHOLD, MAX_KEPT_MEMORY)
