"""Whether stated probabilities are what they say: probability of the first name against the share that is right."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

from .interval import interval
from .judge import Outcome

LIMITS = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)


def reliability(outcomes: Iterable[Outcome]) -> dict[str, Any]:
    """Bins of the stated probability with count, mean stated, share right and its binomial interval.

    `named`: sessions with a name; `stated`: those with its probability. `brier`: mean square of stated minus right (0
    or 1), None without any stated.
    """
    named = [o for o in outcomes if o.answer in ("right name", "wrong name")]
    points = [(o.probability, o.answer == "right name") for o in named if o.probability is not None]
    bins = []
    for low, high in pairwise(LIMITS):
        mine = [(p, right) for p, right in points if low <= p < high or (high == 1.0 and p >= 1.0)]
        if mine:
            hits = sum(right for _, right in mine)
            bins.append(
                {
                    "from": low, "to": high, "n": len(mine), "hits": hits,
                    "stated": sum(p for p, _ in mine) / len(mine), "rate": hits / len(mine),
                    "ci95": list(interval(hits, len(mine))),
                }
            )  # fmt: skip
    brier = sum((p - right) ** 2 for p, right in points) / len(points) if points else None
    return {"named": len(named), "stated": len(points), "brier": brier, "bins": bins}


def lines(found: dict[str, Any]) -> list[str]:
    """The bins as lines for a terminal."""
    out = ["Stated probability of the first name, against the share right"]
    if not found["stated"]:
        return [*out, f"  None stated: {found['named']} sessions have a name, and no report says how probable it is."]
    for b in found["bins"]:
        low, high = b["ci95"]
        said = f"  {b['from']:.2f} to {b['to']:.2f}  stated {b['stated']:.3f}  right {b['hits']:4d} of {b['n']:4d}"
        out.append(f"{said} = {b['rate']:.1%} (95 %: {low:.1%} to {high:.1%})")
    return [*out, f"  Brier score {found['brier']:.3f}; {found['stated']} of {found['named']} names with a probability"]
