"""The laser log of WALT's host tool: lines "<seconds> <0|1>", times rounded to 1 ms."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading import plain_lines
from draglag.reading.files import decoded
from draglag.recording import LaserTrace

_LINE = re.compile(r"\s*(\d{1,12}(?:\.\d{1,9})?)\s+([01])\s*\Z")
ROUNDED = message("the laser's times are rounded to 1 ms by the program that wrote them")


def read_walt_laser(path: Path) -> LaserTrace:
    """Edges on the log's clock. Raises DataError."""
    rows = []
    for number, line in enumerate(decoded(path, plain_lines(path)).split("\n"), 1):
        if not line.strip():
            continue
        found = _LINE.match(line)
        if found is None:
            raise DataError(
                message(
                    "{path}, line {line}: “{text}” is not “<seconds> <0 or 1>”",
                    path=path,
                    line=number,
                    text=line.strip()[:40],
                ),
                "Correct or remove that line",
            )
        rows.append((float(found[1]), int(found[2])))
        if len(rows) > 1 and rows[-1][0] < rows[-2][0]:
            raise DataError(
                message("{path}, line {line}: the time goes back", path=path, line=number),
                "Correct or remove that line",
            )
    if not rows:
        raise DataError(message("{path}: holds no edges", path=path), "Expected lines of “<seconds> <0 or 1>”")
    light = np.array([level for _, level in rows], np.int64)
    return LaserTrace(np.array([t_s for t_s, _ in rows]), light, missed=int((np.diff(light) == 0).sum()))
