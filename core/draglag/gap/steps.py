"""The report of a judgement."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from draglag.errors import EstimateError
from draglag.gap.by_taps import creep_of
from draglag.gap.constants import DOUBT, PROBABLE, PROMISING, STATED_AT_MOST
from draglag.gap.fitting.heldout import floor_mm, gap_mm, predictive_gain, shrinks, shrinks_or_predicts
from draglag.gap.fitting.joint import Fit, fit_session, gained_nats
from draglag.gap.fitting.law_form import LAW_FORM, remainder_rms_s
from draglag.gap.fitting.parameters import parameters_of, where_of
from draglag.gap.posterior.answer import Answer, answer_of
from draglag.gap.posterior.judge import Judgement, grown
from draglag.gap.posterior.misfit import parameters_with_misfit
from draglag.gap.posterior.pool import Names
from draglag.gap.posterior.search import log_evidence
from draglag.gap.proposing.proposals import shown_by_traces
from draglag.gap.replaying.realised import made
from draglag.gap.results import BY_TAPS, GapReport, LawStatement, NoisePart, Step, Tolerated, next_to_unnamed
from draglag.gap.steps_by_taps import with_taps
from draglag.gap.streams.interpolated import is_interpolated
from draglag.gap.streams.stalls import FOLLOWS as STALLS_FOLLOW
from draglag.gap.streams.stalls import stalls
from draglag.gap.streams.stamps import StreamEffect
from draglag.gap.traces.run_data import gather
from draglag.messages import joined, message
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, effect_class, twins_of

OF_EDGES = ("spurious_edges", "excess_scatter", "missed_edges")
"""Flags of a run whose edges are left out in part, or scatter."""
Streams = tuple[tuple[StreamEffect, ...], tuple[StreamEffect, ...]]
"""What the streams show: effects that may be named, and those that the library given does not have."""


def reported(
    sessions: tuple[Session, Session],
    judgement: Judgement,
    streams: Streams,
    allowed: frozenset[str],
    max_effects: int,
) -> GapReport:
    """Report of a judgement. sessions: as measured, and as repaired."""
    session, ready = sessions
    named, strange = streams
    answer = answer_of(judgement.pool)
    chain, idle = _that_hold(fits_in_order(ready, judgement, answer.effects))
    edges = np.logical_and.reduce([link.after.counted for link in chain])
    if (answer.unexplained_by or idle) and len(answer.effects) < max_effects:
        chain = _that_explain(chain, edges)
    last = chain[-1].after
    law = law_of(judgement, last)
    steps = stream_steps(session, named, judgement.base)
    for link in chain[1:]:
        step = step_of(session, judgement, answer, allowed, link.effect, link.before, link.after, last)
        gaps = gap_mm(link.before, edges), gap_mm(link.after, edges)
        steps.append(replace(step, gap_before_mm=gaps[0], gap_after_mm=gaps[1]))
    unexplained = answer.unexplained_by or idle or _unnamed_in_streams(sessions, strange, judgement.base, allowed)
    if unexplained:
        steps = [next_to_unnamed(step) for step in steps]
    last_mm = gap_mm(last, edges)
    if unexplained is None:
        more, last = with_taps(session, judgement, last, steps, allowed, law.probability)
        steps += more
        last_mm = gap_mm(last, edges)
    stated = [answer.probability, *(step.probability for step in steps if not unexplained)]
    return GapReport(
        session.name,
        "unexplained" if unexplained else "explained" if steps else "no_gap",
        tuple(steps),
        floor_mm(last, edges),
        steps[0].gap_before_mm if steps and steps[0].covariate != BY_TAPS else last_mm,
        last_mm,
        unexplained,
        min(stated),
        answer.explanations,
        law,
        tuple(Tolerated(*item) for item in answer.tolerated),
        noise=noise_parts(judgement),
        flagged=_flagged(judgement.base),
        first=judgement.base,
        last=last,
        judgement=judgement,
        stopped_at=max_effects if unexplained and len(steps) >= max_effects else None,
    )


def _flagged(fit: Fit) -> dict[str, str]:
    each = {d.run.id: [f for f in d.estimate.flags if f in OF_EDGES] for d in fit.runs if d.estimate is not None}
    return {run: ", ".join(flags) for run, flags in each.items() if flags}


def noise_parts(judgement: Judgement) -> tuple[NoisePart, ...]:
    """Parts under the best explanation, largest first."""
    found = judgement.pool.found[judgement.pool.best]
    search = found.search
    levels = search.levels[int(np.argmax(log_evidence(search, found.explanation)))]
    sizes_mm = search.linear.parts.rms_mm(levels)
    parts = [NoisePart(name, float(getattr(levels, name, 0.0)), size_mm) for name, size_mm in sizes_mm.items()]
    return tuple(sorted((one for one in parts if one.size_mm), key=lambda one: -one.size_mm))


@dataclass(frozen=True)
class Link:
    """One effect added; the first of a chain adds none."""

    effect: str
    before: Fit
    after: Fit


def _that_hold(chain: list[Link]) -> tuple[list[Link], str | None]:
    """Chain up to the first effect that held-out runs do not support, and its covariate."""
    k = 1
    while k < len(chain):
        together = (m for m in range(k, len(chain)) if shrinks_or_predicts(chain[k].before, chain[m].after))
        last = next(together, None)
        if last is None:
            return chain[:k], effect_class(chain[k].effect).follows
        k = last + 1
    return chain, None


def _that_explain(chain: list[Link], edges: np.ndarray) -> list[Link]:
    """Chain up to the first effect that explains less than stays unnamed."""
    last = chain[-1].after
    unexplained = gap_mm(last, edges) ** 2 - floor_mm(last, edges) ** 2
    for k, link in enumerate(chain[1:], start=1):
        if gap_mm(link.before, edges) ** 2 - gap_mm(link.after, edges) ** 2 < unexplained:
            return chain[:k]
    return chain


def law_of(judgement: Judgement, fit: Fit) -> LawStatement:
    """Statement on the curve's form."""
    p = judgement.pool.probability_of(LAW_FORM)
    return LawStatement(p < PROBABLE, p, remainder_rms_s(fit.law, fit.view.speed))


def fits_in_order(session: Session, judgement: Judgement, effects: Names) -> list[Link]:
    """First fit, then one more effect each, in order of gap closed."""
    pool, fits = judgement.pool, dict(judgement.fits)
    out = [Link("", judgement.base, judgement.base)]
    names: Names = ()
    left = set(effects)
    while left:
        options: dict[str, Fit] = {}
        for name in left:
            wanted = tuple(sorted((*names, name)))
            if wanted not in fits:
                fits |= grown(session, fits, pool, wanted)
            if wanted in fits:
                options[name] = fits[wanted]
        if not options:
            break
        edges = np.logical_and.reduce([fit.use for fit in options.values()])
        first = min(options, key=lambda name: gap_mm(options[name], edges))
        names = tuple(sorted((*names, first)))
        out.append(Link(first, out[-1].after, options[first]))
        left.remove(first)
    return out


def step_of(
    session: Session,
    judgement: Judgement,
    answer: Answer,
    allowed: frozenset[str],
    name: str,
    before: Fit,
    after: Fit,
    last: Fit | None = None,
) -> Step:
    """One effect as a step. last: fit that gives the parameters."""
    last = last or after
    alike = [e for e in (name, *twins_of(name)) if e in allowed] or [name]
    p_other = law_of(judgement, last).probability
    creep = creep_of(session, last, tuple(made(e, _values(e, last)) for e in alike), p_other)
    effect = creep.best if len(alike) > 1 else alike[0]
    rivals = [e for e in alike if e != effect and creep.shares[e] > DOUBT]
    instead = _rivals(answer, name)
    rivals += instead
    p = min(judgement.pool.probability_of(name, *instead), STATED_AT_MOST)
    p *= sum(creep.shares[e] for e in alike if e == effect or e in rivals)  # of all that the step names
    gained = deviance_gained(before, after)
    evidence: list[str] = [message("deviance falls by {gained:.0f}", gained=gained)]
    nats = 0.0 if shrinks(before, after) else predictive_gain(before, after)
    if nats > 0:
        better = message("held-out runs, whose RMS does not fall, are predicted better by {nats:.0f} nats", nats=nats)
        evidence.append(better)
    if len(alike) > 1 and session.taps is not None:
        evidence.append(creep.evidence)
    added = max(after.design.shape[1] - before.design.shape[1], 1)
    return Step(
        effect,
        parameters_with_misfit(effect, last),
        where_of(effect, last),
        effect_class(effect).follows,
        float(chdtrc(added, max(gained, 0.0))),
        joined("; ", evidence),
        gap_mm(before),
        gap_mm(after),
        float(p),
        tuple(dict.fromkeys(rivals)),
        effect_class(effect).separated_by if rivals else "",
        after,
    )


def _values(effect: str, fit: Fit) -> dict[str, float]:
    return {key: value for key, (value, _) in parameters_of(effect, fit).items()}


def _rivals(answer: Answer, name: str) -> list[str]:
    """Effects that replace this one in other probable explanations."""
    best = set(answer.effects)
    out = []
    for names, p in answer.explanations:
        other = set(names) & set(EFFECTS)
        if p > DOUBT and name not in other and len(other - best) == 1 and best - other == {name}:
            out += sorted(other - best)
    return out


def deviance_gained(before: Fit, after: Fit) -> float:
    """Twice the log-likelihood gained on common edges."""
    return 2 * gained_nats(before, after)


def stream_steps(session: Session, found: tuple[StreamEffect, ...], repaired: Fit) -> list[Step]:
    """Steps of effects that streams show, repaired at once."""
    if not found:
        return []
    after = gap_mm(repaired)
    try:
        before = gap_mm(fit_session(session, gather(session)))
    except (EstimateError, np.linalg.LinAlgError, ValueError):
        before = after
    return [
        Step(
            item.effect,
            item.parameters,
            item.where,
            effect_class(item.effect).follows,
            1e-9,
            item.evidence,
            before if k == 0 else after,
            after,
            STATED_AT_MOST,
            item.rivals,
            effect_class(item.effect).separated_by if item.rivals else "",
        )
        for k, item in enumerate(found)
    ]


def _unnamed_in_streams(
    sessions: tuple[Session, Session], strange: tuple[StreamEffect, ...], base: Fit, allowed: frozenset[str]
) -> str | None:
    """Covariate of what streams or traces show and no allowed effect explains."""
    if strange:
        return effect_class(strange[0].effect).follows
    shown = (e for e in EFFECTS if e not in allowed and shown_by_traces(base, e) > PROMISING)
    found = next(shown, None)
    if found is not None:
        return effect_class(found).follows
    return STALLS_FOLLOW if all(stalls(session) or is_interpolated(session) for session in sessions) else None
