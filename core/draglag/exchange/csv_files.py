"""One tidy folder of plain CSV for spreadsheets and statistics programs: runs, edges, touch, taps."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from draglag.exchange.folder import new_folder
from draglag.exchange.tables import write_table
from draglag.recording import Run, Session

_RUN_COLUMNS = (
    "id",
    "protocol",
    "start_s",
    "duration_s",
    "nominal_speed_mm_s",
    "radius_mm",
    "outcome",
)
_COUNT_COLUMNS = ("touch_events", "touch_dropped", "edges", "edges_missed")


def write_csv(session: Session, folder: Path | str) -> Path:
    """Write ``runs.csv``, ``touch.csv``, ``edges.csv`` and ``taps.csv``: one row a record, the run's id in the first
    column, an empty cell where nothing is known. Raises DataError where the folder is not empty."""
    folder = Path(folder)
    with new_folder(folder) as place:
        with (place / "runs.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*_RUN_COLUMNS, *_COUNT_COLUMNS])
            writer.writerows(_run_row(run) for run in session.runs)
        write_table(place / "touch.csv", _touch(session))
        write_table(
            place / "edges.csv",
            {
                "run": [run.id for run in session.runs for _ in run.laser.t_s],
                "t_s": _joined([run.laser.t_s for run in session.runs]),
                "light": np.concatenate([np.empty(0, np.int64), *(run.laser.light for run in session.runs)]),
            },
        )
        if session.taps is not None:
            taps = session.taps
            columns = {"physical_s": taps.physical_s, "registered_s": taps.registered_s, "down": taps.down}
            write_table(place / "taps.csv", columns)
    return folder


def _run_row(run: Run) -> list[object]:
    known = ["" if getattr(run, name) is None else getattr(run, name) for name in _RUN_COLUMNS]
    return [*known, len(run.touch.t_s), run.touch.dropped, len(run.laser.t_s), run.laser.missed]


def _touch(session: Session) -> dict[str, NDArray[Any] | list[str]]:
    columns: dict[str, NDArray[Any] | list[str]] = {"run": [run.id for run in session.runs for _ in run.touch.t_s]}
    for name in ("t_s", "x_mm", "y_mm"):
        columns[name] = _joined([getattr(run.touch, name) for run in session.runs])
    for name in ("contact_id", "x_raw", "y_raw", "device_t_s"):
        if any(len(getattr(run.touch, name)) for run in session.runs):
            columns[name] = [
                cell for run in session.runs for cell in (_cells(getattr(run.touch, name)) or [""] * len(run.touch.t_s))
            ]
    return columns


def _cells(values: NDArray[np.float64] | NDArray[np.int64]) -> list[str]:
    return ["" if value != value else repr(value) for value in values.tolist()]


def _joined(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.concatenate([np.empty(0), *parts])
