"""Find, name, add, shrink, again: until nothing is left or what is left has no name."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np

from draglag.blas import one_blas_thread
from draglag.errors import EstimateError
from draglag.gap.finding.scan import LEVEL, Candidate, Finding, find
from draglag.gap.finding.separate import (
    clock_offset,
    not_seen,
    what_is_missing,
    which_drift,
)
from draglag.gap.finding.stalls import stalls
from draglag.gap.fitting.heldout import clearly_less, floor_mm, gap_mm, improves, shrinks
from draglag.gap.fitting.joint import RIPPLE, Fit, fit_session
from draglag.gap.fitting.parameters import parameters_of, where_of
from draglag.gap.naming.choice import TOO_CLOSE, Name, name, with_times_anew
from draglag.gap.naming.doubts import (
    a_detail,
    beside,
    contradicted_by_taps,
    covariate_of,
    left_out,
    outweighed,
    passed_over,
    path_closes,
    still_there,
    strained,
    without_idle,
    without_parts,
    without_proxies,
)
from draglag.gap.naming.refits import MODE, PLATEAU, RARE, SAME_MODEL_BETTER, gained, refit
from draglag.gap.naming.soundness import excess_between_runs, excess_scatter, follows_another_speed, nameless_ripple
from draglag.gap.naming.together import name_two
from draglag.gap.naming.tries import judged_by
from draglag.gap.results import GapReport, Step
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stamps import StreamEffect
from draglag.gap.traces.run_data import gather
from draglag.latency.conduct import kept_runs
from draglag.provenance import is_simulated
from draglag.recording import Session
from draglag.simulation.effects import effect_class, known_effects, twins_of

MOST_EFFECTS = 6
NEARLY_ALL = 0.8  # of what a free shape explains: the shape is then the name's, and the rest a matter of detail
LEAVE_ANOTHER_SPEED = {"acceleration_lag", "lagging_law", "smoothing_shrink", "second_filter_mode"}
OF_UNSURE_AGE = {"sample_hold", "timestamp_quantisation"}
OF_ITS_GAIN = 0.1  # that the model's own better point gains: less does not make a name
CLOSES = 0.5  # of the gap: a name that closes so much of it is not the model's own search that had stopped short
UNFITTED = (
    "edges that no law can be fitted to: touch or laser misses a large part of most runs, or they are not of one drag"
)
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class _Grace:
    """A name added although a smooth term explains a little more: it has to leave nothing in that covariate."""

    covariate: str
    steps: tuple[Step, ...]
    fit: Fit


@one_blas_thread
def close_gap(
    session: Session,
    max_effects: int = MOST_EFFECTS,
    candidates: Collection[str] | str | None = None,
    progress: Progress | None = None,
    include: Collection[str] = (),
) -> GapReport:
    """Run the workflow on a session, without the runs that went wrong: those that ``analyze`` keeps out of the curve.

    Args:
        candidates: effect ids that may be named; None = the whole library.
        include: ids of runs to take in although they went wrong, or ``all``.

    Never raises for a poor session: the report says what is missing instead of giving a verdict. Raises DataError for a
    candidate that the library does not have.
    """
    allowed = known_effects(candidates)
    tell = progress or (lambda fraction, text: None)
    session, excluded = kept_runs(session, include)
    simulated = is_simulated(session.devices)
    missing = what_is_missing(session)
    if missing:
        return GapReport(session.name, None, missing=missing, excluded=excluded, simulated=simulated)
    tell(0.05, "streams")
    seen, whole = inspect(session)
    strange = tuple(s for s in seen if s.effect not in allowed)
    seen = tuple(s for s in seen if s.effect in allowed)
    repaired = whole if seen else session
    tell(0.15, "fitting the present model")
    try:
        try:
            fit = fit_session(repaired, gather(repaired))
        except (EstimateError, np.linalg.LinAlgError, ValueError):
            if not strange:
                raise
            # What may not be named is there all the same: without it the session can at least be judged.
            repaired = whole
            fit = fit_session(repaired, gather(repaired))
    except (EstimateError, np.linalg.LinAlgError, ValueError) as problem:
        return GapReport(
            session.name,
            None,
            missing=(str(problem) if isinstance(problem, EstimateError) else UNFITTED,),
            excluded=excluded,
            simulated=simulated,
        )
    steps = list(_stream_steps(session, seen, fit))
    first_mm = steps[0].gap_before_mm if steps else gap_mm(fit)
    first = fit
    plateau = False
    # Held positions scatter edges, unless the beat of loop and frames gives their ages away; so do stamps of no
    # certain frame.
    ages = any(s.effect in OF_UNSURE_AGE and not (s.undone and seen) for s in (*seen, *strange))
    finding = find(fit, without=left_out(allowed) | beside((), ages))
    unexplained: Candidate | None = None
    grace: _Grace | None = None
    retries = 2
    looked = PLATEAU not in allowed
    while len(steps) < max_effects and (finding.significant or not (plateau or looked)):
        looked = not finding.significant
        tell(0.2 + 0.12 * len(steps), "naming")
        names, unnamed = name(repaired, fit, finding, allowed, plateau)
        if ages:
            # Edges whose positions are of uneven age are no independent witnesses: the gap itself has to shrink.
            names = [n for n in names if shrinks(fit, n.fit)]
        better = refit(repaired, fit, fit.terms, plateau, names[0].fit.law) if names and retries else None
        closes = bool(names) and better is not None and names[0].gap_after_mm < CLOSES * gap_mm(better)
        least = max(SAME_MODEL_BETTER, OF_ITS_GAIN * names[0].gain) if names else np.inf
        if better is not None and not closes and gained(fit, better) > least:
            # The model itself had not found its best point: an effect must not be named for that.
            retries -= 1
            looked, fit = PLATEAU not in allowed, better
            first, first_mm = (first, first_mm) if steps else (fit, gap_mm(fit))
            finding = find(fit, without=left_out(allowed) | beside((s.effect for s in steps), ages))
            continue
        if unnamed is not None:
            nearly = bool(names) and names[0].gain > NEARLY_ALL * unnamed.score
            if not nearly and not (names and path_closes(repaired, names[0], allowed, plateau)):
                names = []
            else:
                grace = grace or _Grace(unnamed.covariate, tuple(steps), fit)
        if not names and unnamed is not None and unnamed.role.endswith("jump"):
            unexplained = unnamed
            break
        if names:
            added = [names]
        else:
            unexplained = unnamed or still_there(fit, finding)
            if unexplained is None or len(steps) + 2 > max_effects:
                break
            two = name_two(repaired, fit, finding, allowed, plateau, unexplained.score)
            if two is None or (ages and not shrinks(fit, two[1].fit)):
                break
            added, unexplained = [[two[0]], [two[1]]], None
        for found in added:
            found[0] = with_times_anew(repaired, first, found[0], plateau)
            steps.append(step_of(session, found, finding, allowed))
            plateau = plateau or found[0].effect == PLATEAU
            fit = found[0].fit
        fit, steps = without_proxies(repaired, fit, steps, first)
        finding = find(fit, without=left_out(allowed) | beside((s.effect for s in steps), ages))
    searched = fit  # the model that the finding is of
    stopped_at = max_effects if finding.significant and len(steps) >= max_effects else None
    if unexplained is None and finding.significant:
        unexplained = still_there(fit, finding)
    if grace is not None and unexplained is not None and unexplained.covariate == grace.covariate:
        steps, fit = list(grace.steps), grace.fit
    if unexplained is not None and stopped_at is None:
        steps, fit = without_parts(steps, fit, first, unexplained, finding)
    without = contradicted_by_taps(session, fit, first) if unexplained is None else None
    if without is not None:
        fit = searched = without
        steps = [s for s in steps if s.effect != MODE]
        finding = find(fit, without=left_out(allowed) | beside((s.effect for s in steps), ages))
        unexplained = next((c for c in finding.significant if c.effect is None and c.covariate == "speed"), None)
    if unexplained is not None and a_detail(unexplained, steps):
        unexplained = None
    steps = [settled(step, fit) for step in steps]
    if unexplained is None and not ages:
        unexplained = excess_scatter(fit) or excess_between_runs(fit) or (None if steps else strained(fit, finding))
        most = max((s.gain for s in steps), default=0.0)
        if unexplained is not None and unexplained.score > most and stopped_at is None:
            steps, fit = without_parts(steps, fit, first, unexplained, finding)
    if unexplained is None and not ages and not {s.effect for s in steps} & LEAVE_ANOTHER_SPEED:
        unexplained = follows_another_speed(fit)
    coarse = any(s.effect == "timestamp_quantisation" for s in (*seen, *strange))
    if unexplained is None and all(s.effect != "frame_batching" for s in seen):
        unexplained = stalls(whole if coarse else session)  # two stamps alike on a coarse clock are no burst
    if unexplained is None and RIPPLE not in allowed:
        unexplained = nameless_ripple(fit)
    if unexplained is None and stopped_at is None:
        unexplained = outweighed(steps, finding)
    if unexplained is not None and stopped_at is None:
        steps, fit = without_idle(steps, fit, first, unexplained)
    if unexplained is None and strange:
        # Seen in the streams, and there is no name for it to be given.
        unexplained = Candidate(None, effect_class(strange[0].effect).follows, "latency", 0.0, 1, 1, 0.0)
    if unexplained is None and steps and not seen and not (clearly_less(gap_mm(fit), first_mm) or improves(first, fit)):
        # Held-out runs are predicted no better with these names than without: they name nothing.
        unexplained = Candidate(None, steps[0].covariate, "latency", 0.0, 1, 1, 0.0)
        steps, fit = [], first
    if unexplained is None:
        steps += _offset_step(session, fit, steps, allowed)
    if fit is not searched:
        finding = find(fit, without=left_out(allowed) | beside((s.effect for s in steps), ages))
    last_mm = gap_mm(fit)
    verdict = "unexplained" if unexplained else ("explained" if steps else "no_gap")
    tell(1.0, "done")
    return GapReport(
        session.name,
        verdict,
        tuple(steps),
        floor_mm(fit),
        first_mm if steps else last_mm,
        last_mm,
        None if unexplained is None else covariate_of(unexplained),
        finding.p_value,
        (),
        not_seen(session, fit),
        () if unexplained else passed_over(repaired, fit, finding, allowed),
        first,
        fit,
        finding,
        stopped_at,
        excluded,
        simulated,
    )


def step_of(session: Session, names: list[Name], finding: Finding, allowed: frozenset[str]) -> Step:
    """The best name as a step, with those it cannot be told from and the run that would tell them apart."""
    best = names[0]
    effect = best.effect
    close = tuple(n.effect for n in names[1:] if best.gain - n.gain < TOO_CLOSE)
    p_value = next((c.p_value for c in finding.candidates if c.effect == effect), finding.p_value)
    if p_value > LEVEL:  # a change of the law has no column to be found by: it was named for its gain alone
        p_value = min(p_value, LEVEL * float(np.exp(-0.5 * max(best.gain - RARE, 0.0))))
    evidence = f"deviance falls by {best.gain:.0f} after its price"
    if effect == MODE:
        evidence += _of_neither_in_words(best.fit)
    together = tuple(e for e in twins_of(effect) if e in allowed)
    if effect == "clock_drift":
        size = next(t.sizes[0] for t in best.fit.terms if t.effect == effect)
        verdict = which_drift(session, best.fit, size, allowed)
        effect, together, evidence = verdict.effect, verdict.indistinguishable_from, f"{evidence}; {verdict.evidence}"
    elif effect == "beam_width" and effect not in allowed:
        effect, together = "scale_error", ()
    return Step(
        effect,
        parameters_of(effect, best.fit),
        where_of(effect, best.fit),
        effect_class(effect).follows,
        p_value,
        evidence,
        best.gap_before_mm,
        best.gap_after_mm,
        tuple(dict.fromkeys((*together, *close))),
        effect_class(effect).shown_apart_by if together or close else "",
        best.gain,
        best.fit,
    )


def settled(step: Step, fit: Fit) -> Step:
    """The step with its numbers from the final fit, beside all other effects."""
    numbers = parameters_of(step.effect, fit)
    if not numbers or step.fit is None:
        return step
    evidence = step.evidence
    if step.effect == MODE:  # its times may have been settled anew
        evidence = evidence.removesuffix(_of_neither_in_words(step.fit)) + _of_neither_in_words(fit)
    return replace(step, parameters=numbers, where=where_of(step.effect, fit), evidence=evidence)


def _of_neither_in_words(fit: Fit) -> str:
    if fit.only is None:
        return ""
    others = [term for term in fit.terms if term.effect != MODE]
    count = np.count_nonzero(~fit.only & judged_by(fit.placed, others))
    return f"; {count} edges about its switches are of neither filter, and left out"


def _stream_steps(session: Session, seen: tuple[StreamEffect, ...], repaired: Fit) -> Iterable[Step]:
    if not seen:
        return
    after = gap_mm(repaired)
    try:
        before = gap_mm(fit_session(session, gather(session)))
    except (EstimateError, np.linalg.LinAlgError, ValueError):
        before = after
    for k, item in enumerate(seen):
        yield Step(
            item.effect,
            item.parameters,
            item.where,
            effect_class(item.effect).follows,
            1e-9,
            item.evidence,
            before if k == 0 else after,
            after,
        )


def _held_s(steps: list[Step], session: Session) -> float:
    """By how much stamps that are held or rounded part taps from drags, if one waits and the other does not: on the
    mean by half of the longest wait."""
    size = {s.effect: next(iter(s.parameters.values()))[0] for s in steps}
    frame_s = float(np.median([np.mean(np.diff(r.touch.t_s)) for r in session.runs if r.touch.t_s.size > 2]))
    longest_s = (
        size.get("timestamp_quantisation", 0.0),
        1 / size["sample_hold"] if "sample_hold" in size else 0.0,
        size.get("frame_batching", 0.0) * frame_s,
    )
    return 0.5 * max(longest_s)


def _offset_step(session: Session, fit: Fit, steps: list[Step], allowed: frozenset[str]) -> list[Step]:
    if "clock_offset" not in allowed:
        return []
    creep = 0.0
    if any(s.effect == "thermal_drift" for s in steps):
        creep = -next((t.sizes[0] for t in fit.terms if t.effect == "clock_drift"), 0.0)
    offset = clock_offset(session, fit, creep, _held_s(steps, session))
    if offset is None:
        return []
    # A low-pass delays as well as it shrinks: taps then lie below the asymptote by about its time constant.
    if any(s.effect == "smoothing_shrink" for s in steps) and offset.value_s < 0:
        return []
    same = gap_mm(fit)  # the law's own asymptote takes the offset up: only the taps show it
    return [
        Step(
            "clock_offset",
            {"offset_s": (offset.value_s, offset.ci95_s)},
            "every edge alike",
            "taps",
            offset.p_value,
            f"release taps lie {1e3 * offset.value_s:+.1f} ms off the fitted asymptote; edges do not show it",
            same,
            same,
        )
    ]
