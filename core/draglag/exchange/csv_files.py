"""Plain CSV for spreadsheets and statistics programs."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from draglag.exchange.folder import new_folder
from draglag.exchange.results import write_results
from draglag.exchange.streams import TOUCH_MORE
from draglag.exchange.tables import Cells, write_parts, write_table
from draglag.recording import Run, Session
from draglag.store.analysis import StoredAnalysis

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


def write_csv(session: Session, folder: Path | str, results: Sequence[StoredAnalysis] = ()) -> Path:
    """The folder with ``runs.csv``, ``touch.csv``, ``edges.csv``, ``taps.csv`` and ``results.csv``.

    The run's id is a column; unknown cells are empty. Raises DataError where the folder is not empty.
    """
    folder = Path(folder)
    with new_folder(folder) as place:
        with (place / "runs.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*_RUN_COLUMNS, *_COUNT_COLUMNS])
            writer.writerows(_run_row(run) for run in session.runs)
        write_parts(place / "touch.csv", _touch_names(session), map(_touch, session.runs), unknown="")
        write_parts(place / "edges.csv", ("run", "t_s", "light"), map(_edges, session.runs))
        write_results(place, results)
        if session.taps is not None:
            taps = session.taps
            columns = {"physical_s": taps.physical_s, "registered_s": taps.registered_s, "down": taps.down}
            write_table(place / "taps.csv", columns)
    return folder


def _run_row(run: Run) -> list[object]:
    known = ["" if getattr(run, name) is None else getattr(run, name) for name in _RUN_COLUMNS]
    return [*known, len(run.touch.t_s), run.touch.dropped, len(run.laser.t_s), run.laser.missed]


def _touch_names(session: Session) -> tuple[str, ...]:
    known = [name for name in TOUCH_MORE if any(len(getattr(run.touch, name)) for run in session.runs)]
    return ("run", "t_s", "x_mm", "y_mm", *known)


def _edges(run: Run) -> dict[str, Cells]:
    return {"run": run.id, "t_s": run.laser.t_s, "light": run.laser.light}


def _touch(run: Run) -> dict[str, Cells]:
    columns = {name: getattr(run.touch, name) for name in ("t_s", "x_mm", "y_mm", *TOUCH_MORE)}
    return {"run": run.id, **{name: values for name, values in columns.items() if len(values)}}
