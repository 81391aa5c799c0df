"""The findings in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.errors import DataError
from draglag.gap.constants import DOUBT, PROBABLE, SIZE_OF_INTEREST_MM
from draglag.gap.results import (
    BY_TAPS,
    UNEXPLAINED,
    GapReport,
    LawStatement,
    Step,
    followed,
    stated,
    unexplained_in_words,
)
from draglag.instruments.clocks import rate_words, remapped
from draglag.latency.on_clock import nearby
from draglag.messages import message
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, column_of, effect_class, title_of
from draglag.simulation.effects.parameter import amount, ends, parameter_of, sizes_in_words

_DIGITS = 3  # of a size in a headline. Judgement
FEWEST_STAMPS = 10  # stamps from which a rate is stated. Judgement
LEAST_MISS_S = 5e-6  # smaller ones would be printed as 0.0 ms. Derived
NOISE = {
    "touch": "touch noise",
    "blur": "what an effect leaves unknown",
    "slow_mm": "slow touch noise",
    "speed": "errors of the speed",
    "tremor_mm_s": "tremor",
    "uneven": "changes of speed followed unevenly",
    "run_s": "latency from run to run",
    "run_mm": "offset from run to run",
    "late_s": "lateness of single reports",
    "wander_s": "lateness that wanders",
}
"""Parts of the noise in words."""
Explanations = Sequence[tuple[tuple[str, ...], float]]
"""Sets of effects with their probabilities, the most probable first."""


def cause_in_words(step: Step) -> str:
    """As "clock drift 24.9 ppm (23.7 to 26.2; probability 0.97)", with twins."""
    names = " or ".join(map(title_of, (step.effect, *step.indistinguishable_from)))
    size, interval = _size(step)
    brackets = f"{interval}; " if interval else ""
    return f"{names} {size}".rstrip() + f" ({brackets}probability {stated(step.probability)})"


def _size(step: Step) -> tuple[str, str]:
    if not step.parameters:
        return "", ""
    name, (value, (low, high)) = next(iter(step.parameters.items()))
    spec = parameter_of(EFFECTS[step.effect].parameters, name)
    return amount(spec, value, _DIGITS), " to ".join(ends(spec, (low, high), _DIGITS))


def sizes_of(step: Step) -> list[str]:
    """The step's numbers, each as "extra 12 ms (11.5 to 12.5)"."""
    sizes = {name: value for name, (value, _) in step.parameters.items()}
    ci95 = {name: interval for name, (_, interval) in step.parameters.items()}
    return sizes_in_words(EFFECTS[step.effect].parameters, sizes, ci95)


def headline(report: GapReport) -> str:
    """Verdict, and the run that would separate indistinguishable causes."""
    return " ".join((verdict_in_words(report), *_to_separate(report)))


def verdict_in_words(report: GapReport) -> str:
    """Causes, sizes, probabilities and held-out gap."""
    sizes = f"{report.gap_last_mm or 0.0:.2f} mm, noise {report.noise_floor_mm or 0.0:.2f}"
    mass = dict(report.explanations)
    quiet = f" (probability {stated(mass[()])})" if () in mass else ""
    words = {
        "no_gap": f"No gap worth a name{quiet}: {sizes}; what is left beyond chance is too small to matter."
        if report.tolerated
        else f"No gap{quiet}: {sizes}. What is left is noise.",
        "explained": "What is left beyond chance is too small to matter." if report.tolerated else "",
        "unexplained": unexplained_in_words(
            report.unexplained_by, report.stopped_at, mass.get(UNEXPLAINED), _left_out(report)
        ),
    }.get(report.verdict or "no_gap", "")
    return " ".join(filter(None, (_causes(report, sizes), words)))


def _causes(report: GapReport, sizes: str) -> str:
    by_edges = [step for step in report.steps if step.covariate != BY_TAPS]
    out = []
    if by_edges:
        named, change = ", ".join(map(cause_in_words, by_edges)), f"{report.gap_first_mm or 0.0:.2f} → {sizes}."
        one, whole = len(by_edges) == 1, report.verdict == "explained"
        verb = ("explains" if whole else "is part of") if one else "explain" if whole else "are part of"
        if not whole and all(step.probability < PROBABLE for step in by_edges):
            verb = "may be part of"
        tried = report.verdict == "no_gap"  # added by hand where there is no gap to be part of
        out.append(f"With {named}: {change}" if tried else f"{named[0].upper()}{named[1:]} {verb} the gap: {change}")
    for step in report.steps:
        if step.covariate == BY_TAPS:
            name = cause_in_words(step)
            edges = "" if by_edges else f" Edges do not show it: the gap on held-out runs is {sizes}."
            out.append(f"{name[0].upper()}{name[1:]}, by the taps.{edges}")
    return " ".join(out)


def _left_out(report: GapReport) -> str:
    """That the most probable cause is not in the model; empty if it is."""
    steps = [(step.effect, *step.indistinguishable_from) for step in report.steps]
    found = not_in_model(report.explanations, steps)
    if found is None:
        return ""
    cause = f"{' and '.join(map(title_of, found[0]))} (probability {stated(found[1])})"
    return f"the most probable cause, {cause}, is not in the model: held-out runs have to support an effect"


def _to_separate(report: GapReport) -> list[str]:
    out = []
    for step in report.steps:
        run = separating_run(step.effect, step.indistinguishable_from, step.extra_run)
        if step.indistinguishable_from and run:
            others = " or ".join(map(title_of, step.indistinguishable_from))
            out.append(f"To separate {title_of(step.effect)} from {others}: {run}.")
    return out


def separating_run(effect: str, alike: Sequence[str], extra_run: str) -> str:
    """Recording that would separate them, or empty."""
    known = (EFFECTS[name].separated_by for name in (effect, *alike) if name in EFFECTS)
    return extra_run or next(filter(None, known), "")


def law_in_words(law: LawStatement) -> str:
    """Misfit of Eq. 5; empty if it is adequate."""
    if law.adequate:
        return ""
    missed = f": Eq. 5 misses it by {1e3 * law.misses_s:.2g} ms RMS" if law.misses_s > LEAST_MISS_S else ""
    return (
        f"The curve is not Eq. 5{missed} (probability {stated(law.probability)}); see draglag analyze for the form "
        "that fits."
    )


def tolerated_in_words(report: GapReport) -> str:
    """Structure too small to matter; empty without."""
    items = [f"{_followed(item.follows)}, {item.size_mm:.2f} mm" for item in report.tolerated]
    return f"Tolerated, too small to matter: {'; '.join(items)}." if items else ""


def noise_in_words(report: GapReport) -> str:
    """Parts of the noise of interest; empty without."""
    items = [f"{NOISE[one.name]} {one.size_mm:.2f} mm" for one in report.noise if one.size_mm >= SIZE_OF_INTEREST_MM]
    return f"Noise of the edges, as large as the session has it: {', '.join(items)}." if items else ""


def check_in_words(report: GapReport) -> str:
    """Disagreements of the predictive check; empty without."""
    items = [
        f"{one.name} {one.measured:.3g} measured, {one.simulated:.3g} simulated ({one.unit})"
        for one in report.check
        if not one.agrees
    ]
    return f"Simulated again with the final model, what disagrees: {'; '.join(items)}." if items else ""


def _followed(covariate: str) -> str:
    return title_of(covariate) if covariate in EFFECTS else followed(covariate)


def set_in_words(names: Sequence[str]) -> str:
    """As "clock drift and beam bow", "no effect" or "something without a name"."""
    if tuple(names) == UNEXPLAINED:
        return "something without a name"
    shown = [title_of(name) if name in EFFECTS else name for name in names]
    some = ", ".join(shown[:-1])
    return f"{some} and {shown[-1]}" if some else "".join(shown) or "no effect"


def also_possible(explanations: Explanations, steps: Sequence[Sequence[str]]) -> Explanations:
    """Probable sets beyond the first, without those of ``steps``, each an effect and its rivals."""
    first = tuple(explanations[0][0]) if explanations else ()
    named = {column_of(name) for step in steps for name in step if name in EFFECTS}
    out = []
    for names, p in explanations[1:]:
        swapped = {column_of(name) if name in EFFECTS else name for name in names} <= named
        if p > DOUBT and not (swapped and len(names) == len(first) and first != UNEXPLAINED):
            out.append((tuple(names), p))
    return out


def needs_evidence(covariate: str | None, before_mm: float, after_mm: float) -> bool:
    """Whether a step's gap does not say why it is there: it is not the one before it (by taps), or has grown."""
    return covariate == BY_TAPS or after_mm > before_mm


def not_in_model(explanations: Explanations, steps: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], float] | None:
    """Effects of the most probable explanation that are none of ``steps``, and its probability; None if there are none.

    Steps: each an effect and its rivals.
    """
    if not explanations or tuple(explanations[0][0]) == UNEXPLAINED:
        return None
    named = {column_of(name) for step in steps for name in step if name in EFFECTS}
    names, p = explanations[0]
    left = tuple(name for name in names if column_of(name) not in named)
    return (left, p) if left else None


def also_in_words(report: GapReport) -> str:
    """Other probable explanations; empty without."""
    steps = [(step.effect, *step.indistinguishable_from) for step in report.steps]
    others = also_possible(report.explanations, steps)
    items = [f"{set_in_words(names)} (probability {stated(p)})" for names, p in others]
    return f"Also possible: {', '.join(items)}." if items else ""


def drift_in_analysis(session: Session, report: GapReport) -> str:
    """What ``analyze`` does with a named drift; empty without."""
    step = next((step for step in report.steps if step.covariate == "session_time"), None)
    if step is None:
        return ""
    ppm = drift_of_stamps_ppm(session)
    if ppm is None:
        return message(
            "draglag analyze cannot show this drift: the session holds no comparison of the laser's clock with "
            "the host's."
        )
    _, (low, high) = next(iter(step.parameters.values()))
    if effect_class(step.effect).undone_in == "laser" and low <= ppm <= high:
        return message(
            "draglag analyze sees the same drift: by the session's comparisons of clocks the laser's stamps "
            "run {rate}. It takes that out before it estimates.",
            rate=rate_words(ppm),
        )
    return message(
        "draglag analyze sees another drift: by the session's comparisons of clocks the laser's stamps run {rate}.",
        rate=rate_words(ppm),
    )


def drift_of_stamps_ppm(session: Session) -> float | None:
    """Drift by clock comparisons, positive if fast; None without enough."""
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
