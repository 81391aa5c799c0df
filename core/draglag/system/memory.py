"""Freed memory goes back to the system."""

from __future__ import annotations

import ctypes
import sys
from functools import cache


@cache
def _trim() -> ctypes._NamedFuncPointer | None:
    if not sys.platform.startswith("linux"):
        return None
    return getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc alone has it


def release_freed_memory() -> bool:
    """Whether memory was returned, which arrays of a run have left in the C library's pools.

    glibc keeps what is freed between blocks in use: some 20 MB more after each hour of recording. Some milliseconds.
    """
    trim = _trim()
    return trim is not None and bool(trim(0))
