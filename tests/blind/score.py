"""From outcomes to figures: recall, false alarms, power, parameter error, gap over floor, who is taken for whom."""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import binom

from .answers import answers
from .answers import lines as answer_lines
from .conditions import UNIDENTIFIABLE
from .interval import rate
from .judge import Outcome
from .reliability import lines as reliability_lines
from .reliability import reliability

RECALL, PAIR, OWN_UP, FALSE_ALARMS = 0.95, 0.85, 0.85, 0.03
OTHER_LAW = "none_other_law"
KINDS = ("none", "single", "faint", "pair", "triple", "left_out", "unknown", "below")
WORLDS = ("plain", "realistic")
PROMISED = "plain"  # the realistic world is measured, and promises nothing yet


QUESTIONS = {
    "false_alarms": "False alarms without any effect",
    "other_law": "The same where the law is none of Eq. 5",
    "recall": "Right name first, one effect",
    "pairs": "Both of a pair named",
    "triples": "All three named",
    "left_out": "Removed from the library: left unexplained",
    "unknown": "In no library: left unexplained",
    "below": "Too small to matter: right name, or nothing",
    "fair": "Fair answers of all sessions",
    "spurious": "Sessions with a spurious name next to the hidden ones",
}


def clear(o: Outcome) -> bool:
    """Whether what is hidden shows clearly enough to promise its name: 1.5 × just detectable, or in the streams."""
    return UNIDENTIFIABLE.isdisjoint(o.hidden) and (o.size is None or o.size >= 1.5)


def score_worlds(outcomes: list[Outcome]) -> dict[str, Any]:
    """All figures of one benchmark as plain data, its worlds apart."""
    worlds = {world: [o for o in outcomes if o.world == world] for world in WORLDS}
    return {
        "sessions": len(outcomes),
        "worlds": {world: score(mine) for world, mine in worlds.items() if mine},
        "failures": failures(worlds[PROMISED]),
    }


def score(outcomes: list[Outcome]) -> dict[str, Any]:
    """All figures of one world as plain data."""
    of = {kind: [o for o in outcomes if o.kind == kind] for kind in KINDS}
    rows = []
    for kind, mine in of.items():
        for row, scale in sorted({(o.row, o.scale) for o in mine}):
            rows.append(
                {"kind": kind, "row": row, "scale": scale} | _row([o for o in mine if (o.row, o.scale) == (row, scale)])
            )
    return {
        "sessions": len(outcomes),
        "false_alarms": rate(not o.right for o in of["none"] if o.row != OTHER_LAW),
        "other_law": rate(not o.right for o in of["none"] if o.row == OTHER_LAW),
        "recall": rate(o.right for o in of["single"] if clear(o)),
        "pairs": rate(o.right for o in of["pair"] if clear(o)),
        "triples": rate(o.right for o in of["triple"] if clear(o)),
        "left_out": rate(o.right for o in of["left_out"] if clear(o)),
        "unknown": rate(o.right for o in of["unknown"] if clear(o)),
        "below": rate(o.right for o in of["below"]),
        "fair": rate(o.fair for o in outcomes),
        "spurious": rate(bool(o.spurious) for o in outcomes if o.hidden),
        "gap_over_floor": _quartiles(_ratios(outcomes)),
        "seconds": _quartiles([o.seconds for o in outcomes]),
        "power": power(outcomes),
        "confusion": confusion(outcomes),
        "rows": rows,
        "answers": answers(outcomes),
        "reliability": reliability(outcomes),
    }


def _row(mine: list[Outcome]) -> dict[str, Any]:
    errors = [abs(o.parameter_error) for o in mine if o.parameter_error is not None]
    return {
        "right": rate(o.right for o in mine),
        "spurious": sum(bool(o.spurious) for o in mine),
        "parameter_error": _quartiles(errors),
        "covered": rate(o.covered for o in mine if o.covered is not None),
        "size": _quartiles([o.size for o in mine if o.size is not None]),
        "gap_first_mm": _quartiles([o.gap_first_mm for o in mine if o.gap_first_mm is not None]),
        "gap_last_mm": _quartiles([o.gap_last_mm for o in mine if o.gap_last_mm is not None]),
        "floor_mm": _quartiles([o.floor_mm for o in mine if o.floor_mm is not None]),
        "gap_over_floor": _quartiles(_ratios(mine)),
    }


def _ratios(outcomes: list[Outcome]) -> list[float]:
    return [o.gap_last_mm / o.floor_mm for o in outcomes if o.hidden and o.gap_last_mm is not None and o.floor_mm]


def _quartiles(values: list[float]) -> list[float] | None:
    return [float(q) for q in np.percentile(values, (25, 50, 75))] if values else None


def power(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Rate of the right name first against size in just-detectable sizes, sizes binned by factors of two."""
    found = [(o.size, o.right) for o in outcomes if o.kind in ("single", "faint") and o.size is not None]
    limits = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, np.inf]
    out = []
    for low, high in pairwise(limits):
        flags = [right for size, right in found if low <= size < high]
        if flags:
            out.append({"from": low, "to": high if np.isfinite(high) else None} | rate(flags))
    return out


def confusion(outcomes: list[Outcome]) -> dict[str, dict[str, int]]:
    """Hidden effect (one a session, or none) against the first name given, `nothing` or `unexplained`."""
    out: dict[str, dict[str, int]] = {}
    for o in outcomes:
        if o.kind not in ("none", "single", "unknown", "below"):
            continue
        owned_up = o.verdict == "unexplained" or o.unexplained_by is not None
        said = o.named[0] if o.named else "unexplained" if owned_up else "nothing"
        row = out.setdefault(f"{o.row}, small" if o.kind == "below" else o.row, {})
        row[said] = row.get(said, 0) + 1
    return out


def failures(outcomes: list[Outcome], level: float = 0.005) -> list[str]:
    """Promises that these outcomes contradict: hits so few that the promised rate makes them rarer than `level`."""
    out = []
    bars = (
        ("right name first", [o for o in outcomes if o.kind == "single" and clear(o)], RECALL),
        ("both of a pair named", [o for o in outcomes if o.kind == "pair" and clear(o)], PAIR),
        (
            "unknown or removed effects left unexplained",
            [o for o in outcomes if o.kind in ("unknown", "left_out") and clear(o)],
            OWN_UP,
        ),
        ("sessions without effects left alone", [o for o in outcomes if o.row == "none"], 1 - FALSE_ALARMS),
    )
    for what, mine, promised in bars:
        hits = sum(o.right for o in mine)
        if mine and hits < binom.ppf(level, len(mine), promised):
            wrong = "; ".join(
                f"{o.row} (seed {o.seed}): {', '.join(o.named) or o.verdict}" for o in mine if not o.right
            )
            out.append(f"{what}: {hits} of {len(mine)}, promised {promised:.0%}. Wrong: {wrong}")
    return out


def table(summary: dict[str, Any]) -> str:
    """The figures as lines for a terminal, one world after the other."""
    return "\n\n".join(f"World: {world}, {world_table(found)}" for world, found in summary["worlds"].items())


def world_table(summary: dict[str, Any]) -> str:
    """The figures of one world as lines for a terminal."""
    lines = [f"{summary['sessions']} sessions"]
    for key, what in QUESTIONS.items():
        r = summary[key]
        if r["n"]:
            lines.append(f"  {what:54s}{r['hits']:4d} of {r['n']:4d} = {_percent(r)}")
    if summary["gap_over_floor"]:
        lines.append(
            "  Last held-out gap over the floor, quartiles: " + " ".join(f"{q:.3f}" for q in summary["gap_over_floor"])
        )
    if summary["power"]:
        lines += ["", "Right name first against size (1: just detectable; in the realistic world 0.05 mm RMS)"]
        for p in summary["power"]:
            to = "more" if p["to"] is None else f"{p['to']:g}"
            lines.append(f"  {p['from']:g} to {to:6s}{p['hits']:4d} of {p['n']:4d} = {_percent(p)}")
    lines += [
        "",
        f"{'':9s}{'':24s}{'size':>5s}{'right':>10s}{'spurious':>9s}{'error':>8s}   gap mm: first, last, floor",
    ]
    for row in summary["rows"]:
        error = f"{row['parameter_error'][1]:.0%}" if row["parameter_error"] else ""
        gaps = " ".join(
            f"{row[key][1]:.3f}" if row[key] else "-" for key in ("gap_first_mm", "gap_last_mm", "floor_mm")
        )
        right = f"{row['right']['hits']}/{row['right']['n']}"
        first = f"{row['kind']:9s}{row['row']:24s}{row['scale']:5.1f}{right:>10s}"
        lines.append(first + f"{row['spurious']:9d}{error:>8s}   {gaps}")
    lines += ["", *answer_lines(summary["answers"]), "", *reliability_lines(summary["reliability"])]
    return "\n".join(lines)


def _percent(r: dict[str, Any]) -> str:
    return f"{r['rate']:.1%} (95 %: {r['ci95'][0]:.1%} to {r['ci95'][1]:.1%})"
