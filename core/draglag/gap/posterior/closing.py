"""The workflow by the posterior: the most probable explanation of a session, step by step on held-out runs.

It stands next to ``draglag.gap.workflow`` until it is the better one in every row of the benchmark (docs/gap.md).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from draglag.blas import one_blas_thread
from draglag.errors import EstimateError
from draglag.gap.finding.separate import what_is_missing
from draglag.gap.finding.stalls import stalls
from draglag.gap.fitting.heldout import clearly_less, floor_mm, gap_mm, improves
from draglag.gap.fitting.joint import Fit, fit_session, log_likelihood_on
from draglag.gap.fitting.law_form import LAW_FORM, remainder_rms_s
from draglag.gap.fitting.parameters import parameters_of, where_of
from draglag.gap.posterior.by_taps import clock_offset, creep_of, shares_by_edges
from draglag.gap.posterior.judge import Judgement, grown, judged
from draglag.gap.posterior.pool import Names
from draglag.gap.posterior.verdict import Said, said
from draglag.gap.proposing.proposals import shown_by_traces
from draglag.gap.replaying.realised import made
from draglag.gap.results import Step
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stamps import StreamEffect
from draglag.gap.traces.run_data import gather
from draglag.latency.conduct import kept_runs
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import EFFECTS, Effect, effect_class, known_effects, twins_of

MOST_EFFECTS = 4
BY_TAPS = "taps"  # what a step follows that edges do not show
OPEN_FORM = 0.1  # probability of a curve that is not Eq. 5, from which on its asymptote is open
SHARED = 0.1  # of the probability: an effect that holds so much of it cannot be distinguished
UNFITTED = (
    "edges that no law can be fitted to: touch or laser misses a large part of most runs, or they are not of one drag"
)


@dataclass(frozen=True)
class Law:
    """The curve's form: ``adequate`` is whether Eq. 5 describes it; misses_s: RMS by which the curve misses its nearest
    Eq. 5."""

    adequate: bool = True
    probability: float = 0.0
    misses_s: float = 0.0

    def to_dict(self) -> dict[str, object]:
        form = "double_exponential" if self.adequate else "other"
        return {"form": form, "adequate": self.adequate, "misses_ms": 1e3 * self.misses_s}


@dataclass(frozen=True)
class Closing:
    """What the posterior makes of a session; the fields are those of the design's ``gap --json``. tolerated: what is
    beyond chance and too small to matter, with its probability and size, mm RMS."""

    session: str
    verdict: str | None
    missing: tuple[str, ...] = ()
    steps: tuple[Step, ...] = ()
    noise_floor_mm: float | None = None
    gap_first_mm: float | None = None
    gap_last_mm: float | None = None
    unexplained_by: str | None = None
    probability: float | None = None
    explanations: tuple[tuple[Names, float], ...] = ()
    law: Law = field(default_factory=Law)
    tolerated: tuple[tuple[str, float, float], ...] = ()
    judgement: Judgement | None = field(default=None, repr=False)
    last: Fit | None = field(default=None, repr=False)

    def to_dict(self) -> dict[str, object]:
        return {
            "session": self.session,
            "verdict": self.verdict,
            "missing": list(self.missing),
            "steps": [step.to_dict() for step in self.steps],
            "noise_floor_mm": self.noise_floor_mm,
            "gap_first_mm": self.gap_first_mm,
            "gap_last_mm": self.gap_last_mm,
            "unexplained_by": self.unexplained_by,
            "probability": self.probability,
            "explanations": [{"effects": list(names), "probability": p} for names, p in self.explanations],
            "law": self.law.to_dict(),
        }


@one_blas_thread
def close_by_posterior(
    session: Session, max_effects: int = MOST_EFFECTS, candidates: Collection[str] | str | None = None
) -> Closing:
    """The most probable explanation of a session, without the runs that ``analyze`` keeps out of the curve.

    Args:
        candidates: effect ids that may be named; None = the whole library.

    Never raises for a poor session: ``missing`` says what it lacks. Raises DataError for a candidate that the library
    does not have.
    """
    allowed = known_effects(candidates)
    session, _ = kept_runs(session, ())
    missing = what_is_missing(session)
    if missing:
        return Closing(session.name, None, missing)
    seen, whole = inspect(session)
    named = tuple(item for item in seen if item.effect in allowed)
    strange = tuple(item for item in seen if item.effect not in allowed)
    try:
        ready, first = _first_fit(whole if named else session, whole)
    except (EstimateError, np.linalg.LinAlgError, ValueError) as problem:
        return Closing(session.name, None, (str(problem) if isinstance(problem, EstimateError) else UNFITTED,))
    unsure = any(effect_class(s.effect).uneven_ages and not (s.undone and named) for s in seen)
    judgement = judged(ready, first, allowed, unsure, max(max_effects - len(named), 0))
    return _reported(session, ready, judgement, (named, strange), allowed)


def _first_fit(ready: Session, whole: Session) -> tuple[Session, Fit]:
    """The fit without effects; of the repaired session where the given one cannot be fitted."""
    try:
        return ready, fit_session(ready, gather(ready))
    except (EstimateError, np.linalg.LinAlgError, ValueError):
        if whole is ready:
            raise
        return whole, fit_session(whole, gather(whole))


def _reported(
    session: Session,
    ready: Session,
    judgement: Judgement,
    seen: tuple[tuple[StreamEffect, ...], tuple[StreamEffect, ...]],
    allowed: frozenset[str],
) -> Closing:
    """What a judgement says of the session, and what its names do to held-out runs."""
    named, strange = seen
    verdict = said(judgement.pool)
    chain = fits_in_order(ready, judgement, verdict.effects)
    last = chain[-1][1]
    steps = stream_steps(session, named, judgement.base)
    steps += [
        step_of(session, judgement, verdict, allowed, name, before, after, last)
        for (name, after), (_, before) in zip(chain[1:], chain, strict=False)
    ]
    unexplained = verdict.unexplained_by or _unnamed_in_streams(session, strange, judgement.base, allowed)
    found = steps[len(named) :]
    if found and not (clearly_less(gap_mm(last), gap_mm(judgement.base)) or improves(judgement.base, last)):
        # Held-out runs are predicted no better with these names than without: they name nothing.
        unexplained, steps, last = found[0].covariate, steps[: len(named)], judgement.base
    if unexplained is None:
        more, last = with_taps(session, judgement, last, steps, allowed)
        steps += more
    last_mm = gap_mm(last)
    return Closing(
        session.name,
        "unexplained" if unexplained else "explained" if steps else "no_gap",
        (),
        tuple(steps),
        floor_mm(last),
        steps[0].gap_before_mm if steps and steps[0].covariate != BY_TAPS else last_mm,
        last_mm,
        unexplained,
        min([verdict.probability, *(step.probability for step in steps if step.probability is not None)]),
        verdict.explanations,
        law_of(judgement, last),
        verdict.tolerated,
        judgement,
        last,
    )


def law_of(judgement: Judgement, fit: Fit) -> Law:
    """Whether Eq. 5 describes the curve."""
    p = judgement.pool.probability_of(LAW_FORM)
    return Law(p < 0.5, p, remainder_rms_s(fit.law, fit.view.speed))


def fits_in_order(session: Session, judgement: Judgement, effects: Names) -> list[tuple[str, Fit]]:
    """The fit without effects and those with one effect more each, the effect that says most alone first."""
    pool, fits = judgement.pool, dict(judgement.fits)
    out: list[tuple[str, Fit]] = [("", judgement.base)]
    names: Names = ()
    left = sorted(effects, key=lambda name: -pool.alone(name))
    while left:
        there = next((n for n in left if tuple(sorted((*names, n))) in fits), left[0])
        wanted = tuple(sorted((*names, there)))
        if wanted not in fits:
            fits |= grown(session, fits, pool, wanted)
        if wanted in fits:
            names = wanted
            out.append((there, fits[wanted]))
        left.remove(there)
    return out


def step_of(
    session: Session,
    judgement: Judgement,
    verdict: Said,
    allowed: frozenset[str],
    name: str,
    before: Fit,
    after: Fit,
    last: Fit,
) -> Step:
    """One effect as a step, with those it cannot be distinguished from and the run that would separate them."""
    alike = [e for e in (name, *twins_of(name)) if e in allowed] or [name]
    creep = creep_of(session, last, tuple(made(e, _values(e, last)) for e in alike))
    effect = creep.best if len(alike) > 1 else alike[0]
    rivals = [e for e in alike if e != effect and creep.shares[e] > SHARED]
    rivals += _rivals(verdict, name)
    p = min(judgement.pool.probability_of(name), verdict.probability) * creep.shares[effect]
    gained = deviance_gained(before, after)
    evidence = f"probability {p:.2f}; deviance falls by {gained:.0f}"
    if len(alike) > 1 and session.taps is not None:
        evidence += f"; {creep.evidence}"
    added = max(after.design.shape[1] - before.design.shape[1], 1)
    return Step(
        effect,
        parameters_of(effect, last),
        where_of(effect, last),
        effect_class(effect).follows,
        float(chi2.sf(max(gained, 0.0), added)),
        evidence,
        gap_mm(before),
        gap_mm(after),
        tuple(dict.fromkeys(rivals)),
        effect_class(effect).shown_apart_by if rivals else "",
        fit=after,
        probability=float(p),
    )


def _values(effect: str, fit: Fit) -> dict[str, float]:
    return {key: value for key, (value, _) in parameters_of(effect, fit).items()}


def _rivals(verdict: Said, name: str) -> list[str]:
    """Effects that take the place of one in other explanations which share the mass."""
    best = set(verdict.effects)
    out = []
    for names, p in verdict.explanations:
        other = set(names) & set(EFFECTS)
        if p > SHARED and name not in other and len(other - best) == 1 and best - other == {name}:
            out += sorted(other - best)
    return out


def deviance_gained(before: Fit, after: Fit) -> float:
    """Twice the log-likelihood that ``after`` gains on the edges that both use."""
    both = before.use & after.use
    return 2 * (log_likelihood_on(after, both) - log_likelihood_on(before, both))


def stream_steps(session: Session, seen: tuple[StreamEffect, ...], repaired: Fit) -> list[Step]:
    """What the streams show by themselves, as steps: all are repaired at once."""
    if not seen:
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
            probability=0.99,
        )
        for k, item in enumerate(seen)
    ]


def _unnamed_in_streams(
    session: Session, strange: tuple[StreamEffect, ...], base: Fit, allowed: frozenset[str]
) -> str | None:
    """The covariate of what streams or traces show and the library given has no name for."""
    if strange:
        return effect_class(strange[0].effect).follows
    shown = (e for e in EFFECTS if e not in allowed and shown_by_traces(base, e))
    found = next(shown, None)
    return effect_class(found).follows if found is not None else _stalls(session)


def waited_s(session: Session, effects: Sequence[Effect]) -> float:
    """By how much effects may part taps from drags, if one waits for the host or a filter and the other does not, s."""
    frames = [float(np.mean(np.diff(run.touch.t_s))) for run in session.runs if run.touch.t_s.size > 2]
    frame_s = float(np.median(frames)) if frames else 0.0
    return 0.5 * max((effect.longest_wait_s(frame_s) for effect in effects), default=0.0)


def _stalls(session: Session) -> str | None:
    found = stalls(session)
    return None if found is None else found.covariate


def with_taps(
    session: Session, judgement: Judgement, last: Fit, steps: list[Step], allowed: frozenset[str]
) -> tuple[list[Step], Fit]:
    """Steps for what parts taps from drags, where that is more probable than not, and the fit after them."""
    parting = [e for name, e in EFFECTS.items() if e.parts_taps_from_drags and name in allowed]
    effects = [made(step.effect, {k: v for k, (v, _) in step.parameters.items()}) for step in steps]
    creep = sum(float(np.diff(e.tap_latency(np.zeros(2), np.array([0.0, 1.0])))[0]) for e in effects)
    offset = clock_offset(
        session, last, creep, waited_s(session, effects), judgement.pool.probability_of(LAW_FORM) < OPEN_FORM
    )
    if offset is None or offset.probability < 0.5:
        return [], last
    possible = [e for e in parting if e.parameters[0].lower < offset.value_s < e.parameters[0].upper]
    if not possible:
        return [], last
    moved = {e.id: _moved_mm(e, offset.value_s, last) for e in possible}
    shares = shares_by_edges(judgement.pool, last, moved)
    best = max(shares, key=lambda name: shares[name])
    after = replace(last, residual_mm=last.residual_mm - moved[best])
    rivals = tuple(name for name in shares if name != best and shares[name] > SHARED)
    step = Step(
        best,
        {EFFECTS[best].parameters[0].name: (offset.value_s, offset.ci95_s)},
        "every edge alike",
        BY_TAPS,
        1 - offset.probability,
        f"release taps lie {1e3 * offset.value_s:+.1f} ms off the fitted asymptote",
        gap_mm(last),
        gap_mm(after),
        rivals,
        EFFECTS[best].shown_apart_by if rivals else "",
        fit=after,
        probability=offset.probability * shares[best],
    )
    return [step], after


def _moved_mm(effect: type[Effect], value: float, fit: Fit) -> FloatArray:
    """By how much an effect of known size moves each edge beyond a constant latency, (m,) mm: that is the curve's."""
    made_ = effect.columns_at((value,), fit.view)
    if made_ is None or made_.offset is None:
        return np.zeros(fit.residual_mm.size)
    return np.asarray(made_.offset[:, 0] * value)
