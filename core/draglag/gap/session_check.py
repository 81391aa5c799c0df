"""Whether a session has enough for a verdict."""

from __future__ import annotations

import numpy as np

from draglag.latency.estimate import FEWEST_EDGES
from draglag.latency.steady import has_constant_speed
from draglag.messages import message, phrase
from draglag.recording import FloatArray, Run, Session

SPREAD = 3  # of the largest drag speed over the smallest, which shows a curve. Judgement
BACK_AT_MOST = 0.01  # of the touch events may step back in time. Judgement


def what_is_missing(session: Session) -> tuple[str, ...]:
    """What a session lacks for a verdict, in words."""
    steady = [r for r in session.runs if has_constant_speed(r) and r.laser.t_s.size >= FEWEST_EDGES]
    missing: list[str] = []
    if len(steady) < 5:
        missing.append(
            message(
                "1 run at an even speed with edges: at least 5 are needed"
                if len(steady) == 1
                else "{n} runs at an even speed with edges: at least 5 are needed",
                n=len(steady),
            )
        )
    missing += _too_few_speeds([r.nominal_speed_mm_s for r in steady if r.nominal_speed_mm_s])
    edges = sum(r.laser.t_s.size for r in session.runs)
    if edges < 80:
        missing.append(
            message("1 edge: at least 80 are needed" if edges == 1 else "{n} edges: at least 80 are needed", n=edges)
        )
    disorder = times_out_of_order(session)
    if disorder:
        return (*missing, disorder)
    shown = [r for r in steady if np.count_nonzero(np.isfinite(r.touch.x_mm) & np.isfinite(r.touch.y_mm)) > 50]
    travel = [_travel_mm(r) for r in shown]
    apart = [r for r in shown if _edges_while_touched(r) < FEWEST_EDGES]
    if steady and not shown:
        missing.append(
            message(
                "no run at an even speed shows where the stylus was: its touch positions are missing or not numbers"
            )
        )
    elif travel and max(travel) < 5.0:
        missing.append(message("the runs hardly travel sideways: slope and latency cannot be distinguished"))
    elif apart and len(shown) - len(apart) < 5:
        missing.append(
            message(
                "edges and touch events of {n} of {of} runs at an even speed lie at different times: both have "
                "to be on one clock",
                n=len(apart),
                of=len(steady),
            )
        )
    return tuple(missing)


def times_out_of_order(session: Session) -> str:
    """Sentence on runs with touch times that go back or are no numbers, or empty."""
    bad = [run.id for run in session.runs if _is_out_of_order(run.touch.t_s)]
    if not bad:
        return ""
    some = phrase(", ".join(bad[:3]))
    if len(bad) > 3:
        some = message("{shown} and {n} more", shown=some, n=len(bad) - 3)
    return message(
        "touch times of {runs} go back or are no numbers: exported and imported again they are put in order", runs=some
    )


def _is_out_of_order(t_s: FloatArray) -> bool:
    return bool(not np.isfinite(t_s).all() or np.count_nonzero(np.diff(t_s) < 0) > BACK_AT_MOST * t_s.size)


def _edges_while_touched(run: Run) -> int:
    t_s, slack_s = run.touch.t_s, 1.0
    return int(np.count_nonzero((run.laser.t_s > t_s[0] - slack_s) & (run.laser.t_s < t_s[-1] + slack_s)))


def _too_few_speeds(nominal_mm_s: list[float]) -> list[str]:
    speeds = sorted({round(v) for v in nominal_mm_s})
    if len(speeds) == 1:
        return [message("1 drag speed: at least 4, spread over a factor of 3, are needed")]
    if 0 < len(speeds) < 4:
        return [message("{n} drag speeds: at least 4, spread over a factor of 3, are needed", n=len(speeds))]
    factor = speeds[-1] / max(speeds[0], 1) if speeds else SPREAD
    if factor >= SPREAD:
        return []
    return [message("drag speeds within a factor of {factor:.1f}: they have to spread over one of 3", factor=factor)]


def _travel_mm(run: Run) -> float:
    x = run.touch.x_mm[np.isfinite(run.touch.x_mm)]
    return float(np.ptp(x)) - 2 * (run.radius_mm or 0.0) if x.size else 0.0
