"""What was said of the sessions of each row: right name, wrong name, unexplained, quiet; and how much of it is fair."""

from typing import Any

import numpy as np

from .interval import rate
from .judge import Outcome

ANSWERS = ("right name", "wrong name", "unexplained", "quiet", "refused")


def answers(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """One row a kind and row of sessions: counts of the answers, rate of fair ones, median displacements mm."""
    out = []
    for kind, row in sorted({(o.kind, o.row) for o in outcomes}):
        mine = [o for o in outcomes if (o.kind, o.row) == (kind, row)]
        counts = {answer: sum(o.answer == answer for o in mine) for answer in ANSWERS}
        out.append(
            {"kind": kind, "row": row, "fair": rate(o.fair for o in mine)}
            | {"answers": counts}
            | {"displaced_mm": _median([o.displaced_mm for o in mine]), "gap_mm": _median([o.left_mm for o in mine])}
        )
    return out


def lines(rows: list[dict[str, Any]]) -> list[str]:
    """The rows for a terminal."""
    head = f"{'':9s}{'':26s}{'fair':>8s}{'right':>7s}{'wrong':>7s}{'unexpl.':>8s}{'quiet':>7s}{'refused':>9s}"
    out = ["Answers; quiet is fair where the effect leaves less than 0.05 mm RMS", head + "   mm moved, left (median)"]
    for row in rows:
        said = [row["answers"][answer] for answer in ANSWERS]
        fair = f"{row['fair']['hits']}/{row['fair']['n']}"
        sizes = " ".join("-" if row[key] is None else f"{row[key]:.3f}" for key in ("displaced_mm", "gap_mm"))
        counts = f"{said[0]:7d}{said[1]:7d}{said[2]:8d}{said[3]:7d}{said[4]:9d}"
        out.append(f"{row['kind']:9s}{row['row']:26s}{fair:>8s}{counts}   {sizes}")
    return out


def _median(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None
