"""Memory that a run's arrays took is not kept once they are freed."""

import ctypes
import subprocess
import sys

import pytest

# Blocks too small to be mapped on their own, each second of which stays in use.
_HOLED = """
import sys
from pathlib import Path
from draglag.system.memory import release_freed_memory

def resident():
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])

blocks = [bytearray(60_000) for _ in range(4000)]
full = resident()
kept = blocks[::2]
del blocks
freed = resident()
released = release_freed_memory()
print(full, freed, resident(), released)
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="the C library has no malloc_trim")
def test_what_is_freed_between_blocks_in_use_goes_back_to_the_system() -> None:
    done = subprocess.run([sys.executable, "-c", _HOLED], capture_output=True, text=True, check=True)
    full, freed, after, released = done.stdout.split()
    of_holes = 2000 * 60_000
    assert released == "True"
    assert int(full) - int(freed) < 0.1 * of_holes
    assert int(full) - int(after) > 0.9 * of_holes
