"""The work on one of many sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from draglag.analysis import Analysis, AnalysisOptions, analyze
from draglag.errors import DraglagError
from draglag.provenance import is_simulated
from draglag.recording import Session
from draglag_app.cli.common import keep_result

if TYPE_CHECKING:
    from draglag.store import FileState

AT_MM_S = (50.0, 100.0, 200.0, 400.0, 800.0)  # speeds at which a row has the curve: each twice the one before
SHOWN = 40  # points of a sparkline, of some 160 pixels

ABOUT = ("file", "session", "screen", "simulated", "started_utc")
ANALYSIS_COLUMNS = (
    *ABOUT, "estimator", "n_runs", "n_latencies", "form", "rms_ms", "speed_low_mm_s", "speed_high_mm_s",
    *(f"latency_{v:.0f}_mm_s_{part}" for v in AT_MM_S for part in ("ms", "low_ms", "high_ms")),
    "tap_touch_ms", "tap_release_ms", "n_warnings", "problem",
)  # fmt: skip
GAP_COLUMNS = (
    *ABOUT, "verdict", "probability", "effects", "unexplained_by", "gap_first_mm", "gap_last_mm", "noise_floor_mm",
    "law_adequate", "problem",
)  # fmt: skip


@dataclass(frozen=True)
class Sparkline:
    """A small picture: line, marks, level."""

    x: tuple[float, ...] = ()
    y: tuple[float, ...] = ()
    marks: tuple[tuple[float, float], ...] = ()
    floor: float | None = None


@dataclass(frozen=True)
class Outcome:
    """One session's results, or ``problem``."""

    file: str
    row: dict[str, Any]
    runs: tuple[dict[str, Any], ...] = ()
    result: dict[str, Any] = field(default_factory=dict)
    picture: Sparkline = Sparkline()
    problem: str = ""


@dataclass(frozen=True)
class Analysing:
    """``draglag analyze`` on one path."""

    options: AnalysisOptions
    save: bool | None = None

    def __call__(self, path: Path) -> Outcome:
        return _or_problem(path, self._done)

    def _done(self, path: Path) -> Outcome:
        from draglag.analysis.tables import run_rows

        session, state = _load(path)
        analysis = analyze(session, self.options)
        result = analysis.to_dict()
        if self.save is not False:
            keep_result(path, state, result, self.options.kept(), must=bool(self.save))
        row = _about(path, session) | _analysis_row(analysis)
        if not row["n_latencies"]:
            row["problem"] = "no run gave a latency"
        runs = tuple({"file": str(path), "session": session.name, **one} for one in run_rows(analysis))
        return Outcome(str(path), row, runs, result, _curve_picture(analysis), str(row["problem"] or ""))


@dataclass(frozen=True)
class FindingGap:
    """``draglag gap`` on one path."""

    max_effects: int
    without: Sequence[str] = ()
    include: Sequence[str] = ()

    def __call__(self, path: Path) -> Outcome:
        return _or_problem(path, self._done)

    def _done(self, path: Path) -> Outcome:
        from draglag.gap.workflow import close_gap
        from draglag.simulation.effects import EFFECTS

        session, _ = _load(path)
        found = close_gap(session, self.max_effects, [e for e in EFFECTS if e not in self.without], None, self.include)
        row = _about(path, session) | {
            "verdict": found.verdict,
            "probability": found.probability,
            "effects": " ".join(step.effect for step in found.steps),
            "unexplained_by": found.unexplained_by,
            "gap_first_mm": found.gap_first_mm,
            "gap_last_mm": found.gap_last_mm,
            "noise_floor_mm": found.noise_floor_mm,
            "law_adequate": found.law.adequate,
            "problem": "" if found.verdict else f"no verdict: {'; '.join(found.missing)}",
        }
        gaps = [found.gap_first_mm, *(step.gap_after_mm for step in found.steps)]
        known = tuple(gap for gap in gaps if gap is not None)
        picture = Sparkline(tuple(map(float, range(len(known)))), known, (), found.noise_floor_mm)
        return Outcome(str(path), row, (), found.to_dict(), picture, str(row["problem"]))


def _or_problem(path: Path, work: Any) -> Outcome:
    try:
        done: Outcome = work(path)
    except DraglagError as error:
        problem = str(error)
    except Exception as error:  # a bug on one session is that session's problem here
        problem = f"{path}: unexpected {type(error).__name__}: {error}"
    else:
        return done
    return Outcome(str(path), {"file": str(path), "problem": problem}, problem=problem)


def _load(path: Path) -> tuple[Session, FileState | None]:
    if path.is_file() and path.name != "session.json":
        from draglag.store import read_with_state

        return read_with_state(path)
    from draglag.face import read

    return read(path), None


def _about(path: Path, session: Session) -> dict[str, Any]:
    about = (str(path), session.name, session.screen.name, is_simulated(session.devices), session.started_utc)
    return dict(zip(ABOUT, about, strict=True))


def _analysis_row(analysis: Analysis) -> dict[str, Any]:
    curve = analysis.curve
    row: dict[str, Any] = {
        "estimator": analysis.options.estimator,
        "n_runs": len(analysis.runs),
        "n_latencies": sum(run.latency_s is not None for run in analysis.runs),
        "n_warnings": len(analysis.warnings),
        "problem": "",
    }
    for name, taps in analysis.taps.items():
        row[f"tap_{name}_ms"] = 1e3 * taps.median_s
    if curve is None:
        return row
    low, high = curve.speed_range_mm_s
    row |= {"form": curve.form, "rms_ms": 1e3 * curve.rms_s, "speed_low_mm_s": low, "speed_high_mm_s": high}
    for v in AT_MM_S:
        if low <= v <= high:
            at = np.array([v])
            values = (curve.predict_s(at), *curve.band_s(at))
            for part, value_s in zip(("ms", "low_ms", "high_ms"), values, strict=True):
                row[f"latency_{v:.0f}_mm_s_{part}"] = 1e3 * float(value_s[0])
    return row


def _curve_picture(analysis: Analysis) -> Sparkline:
    marks = tuple(
        (run.speed_mm_s, run.latency_ms)
        for run in analysis.runs
        if run.speed_mm_s is not None and run.latency_ms is not None
    )
    if analysis.curve is None:
        return Sparkline(marks=marks)
    speed = np.linspace(*analysis.curve.speed_range_mm_s, SHOWN)
    latency_ms = 1e3 * analysis.curve.predict_s(speed)
    return Sparkline(tuple(speed.tolist()), tuple(latency_ms.tolist()), marks)
