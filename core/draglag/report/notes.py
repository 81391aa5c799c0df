"""A report's notes, and how to cite the program."""

from __future__ import annotations

import draglag
from draglag.analysis import Analysis
from draglag.recording import LogEntry, Session


def note_rows(session: Session, analysis: Analysis) -> list[dict[str, str]]:
    """Level, place ("+1:40 run-03") and text of every note, except runs' infos and what the analysis warns of."""
    again = {run: f"; repeated as {by}" for run, by in analysis.repeated.items()}
    rows = [
        {"level": "warning", "place": run, "text": f"not in the curve ({why}{again.get(run, '')})"}
        for run, why in analysis.excluded.items()
    ]
    said = [(note, "") for note in session.notes if note.text not in analysis.warnings]
    said += [(note, run.id) for run in session.runs for note in run.log if note.level != "info"]
    start_s = session.started_s
    if start_s is None:
        start_s = min((run.start_s for run in session.runs), default=0.0)
    for note, run_id in sorted(said, key=lambda pair: pair[0].t_s):
        rows.append({"level": note.level, "place": _place(note, start_s, run_id), "text": note.text})
    return rows


def citation() -> str:
    """A reference to copy (CITATION.cff)."""
    return (
        "The draglag authors. draglag: measure, model and compensate the drag latency of touchscreens. Software, "
        f"version {draglag.__version__}."
    )


def _place(note: LogEntry, start_s: float, run_id: str) -> str:
    after_s = max(0, round(note.t_s - start_s))
    return f"+{after_s // 60}:{after_s % 60:02d} {run_id}".strip()
