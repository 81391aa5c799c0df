"""The finding in sentences: which cause, of what size, how far the gap shrinks; which drift analyze speaks of."""

from __future__ import annotations

import numpy as np

from draglag.clocks import rate_words, remapped
from draglag.errors import DataError
from draglag.gap.results import GapReport, Step, unexplained_in_words
from draglag.latency.on_clock import nearby
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, effect_class, title_of

# Unit of an effect's parameter in code → unit people read, and how many of it make one of the former.
READ_AS = {
    "s": ("ms", 1e3), "s/h": ("ms/h", 1e3), "s per mm/s²": ("ms/(m/s²)", 1e6), "1": ("", 1.0), "1/min": ("/min", 1.0)
}  # fmt: skip
FEWEST_STAMPS = 10  # for a rate


def size_in_words(step: Step) -> str:
    """The first parameter of a step with its 95 % interval, as "24.9 ppm (23.7 to 26.2)"; empty without one."""
    if not step.parameters:
        return ""
    name, (value, (low, high)) = next(iter(step.parameters.items()))
    unit = next((spec.unit for spec in EFFECTS[step.effect].parameters if spec.name == name), "1")
    read, factor = READ_AS.get(unit, (unit, 1.0))
    return f"{factor * value:.3g}{' ' if read else ''}{read} ({factor * low:.3g} to {factor * high:.3g})"


def cause_in_words(step: Step) -> str:
    """An effect, its twins and its size: "clock drift or thermal drift 24.9 ppm (23.7 to 26.2)"."""
    names = " or ".join(map(title_of, (step.effect, *step.indistinguishable_from)))
    return f"{names} {size_in_words(step)}".rstrip()


def headline(report: GapReport) -> str:
    """The verdict in one or two sentences: the causes with their sizes and what they do to the held-out gap."""
    sizes = f"{report.gap_last_mm or 0.0:.2f} mm, noise {report.noise_floor_mm or 0.0:.2f}"
    words = {
        "no_gap": f"No gap worth a name: {sizes}; what is left beyond chance is too little for one."
        if report.passed_over
        else f"No gap: {sizes}. What is left is noise.",
        "explained": "What is left beyond chance is too little for a name." if report.passed_over else "",
        "unexplained": unexplained_in_words(report.unexplained_by, report.stopped_at),
    }.get(report.verdict or "no_gap", "")
    return " ".join(filter(None, (_causes(report, sizes), words)))


def _causes(report: GapReport, sizes: str) -> str:
    by_edges = [step for step in report.steps if step.covariate != "taps"]
    out = []
    if by_edges:
        named = ", ".join(map(cause_in_words, by_edges))
        whole = report.verdict == "explained"
        verb = ("explains" if whole else "is part of") if len(by_edges) == 1 else "explain" if whole else "are part of"
        out.append(f"{named[0].upper()}{named[1:]} {verb} the gap: {report.gap_first_mm or 0.0:.2f} → {sizes}.")
    for step in report.steps:
        if step.covariate == "taps":
            name = cause_in_words(step)
            edges = "" if by_edges else f" Edges do not show it: the gap on held-out runs is {sizes}."
            out.append(f"{name[0].upper()}{name[1:]}, by the taps.{edges}")
    return " ".join(out)


def drift_in_analysis(session: Session, report: GapReport) -> str:
    """What ``analyze`` makes of the drift that the gap report names; empty where it names none."""
    step = next((step for step in report.steps if step.covariate == "session_time"), None)
    if step is None:
        return ""
    ppm = drift_of_stamps_ppm(session)
    if ppm is None:
        return (
            "draglag analyze says nothing of this drift: the session holds no comparison of the laser's clock with "
            "the host's."
        )
    _, (low, high) = next(iter(step.parameters.values()))
    if effect_class(step.effect).undone_in == "laser" and low <= ppm <= high:
        return (
            f"draglag analyze sees the same drift: by the session's comparisons of clocks the laser's stamps run "
            f"{rate_words(ppm)}. It takes that out before it estimates."
        )
    return (
        f"draglag analyze sees another drift: by the session's comparisons of clocks the laser's stamps run "
        f"{rate_words(ppm)}."
    )


def drift_of_stamps_ppm(session: Session) -> float | None:
    """By how much the laser's stamps run fast against the session's own comparisons of clocks; None without any."""
    if not session.clocks and not any(run.sync for run in session.runs):
        return None
    stamps, off = [], []
    for run in session.runs:
        if not len(run.laser.device_t_s):
            continue
        try:
            mapped = remapped(run, nearby(run, session.clocks))
        except DataError:
            return None
        stamps.append(mapped.laser.t_s)
        off.append(run.laser.t_s - mapped.laser.t_s)
    t_s = np.concatenate(stamps) if stamps else np.empty(0)
    if t_s.size < FEWEST_STAMPS:
        return None
    return float(1e6 * np.polyfit(t_s - t_s.mean(), np.concatenate(off), 1)[0])
