"""At each start, what killed commands left where this one works is swept away."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from draglag.temporary import sweep


def sweep_for(arguments: Sequence[str]) -> list[Path]:
    """Sweep the present folder and those that the arguments of a command lie in; returns what was removed."""
    try:
        folders = {os.getcwd()} | {os.path.dirname(os.path.abspath(text.rpartition("=")[2])) for text in arguments}
    except OSError:  # the present folder was removed
        return []
    return [path for folder in sorted(folders) if "\0" not in folder for path in sweep(Path(folder))]
