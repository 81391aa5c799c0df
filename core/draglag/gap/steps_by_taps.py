"""Step from the difference of taps and drags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from draglag.gap.by_taps import Offset, clock_offset, shares_by_edges
from draglag.gap.constants import DOUBT
from draglag.gap.fitting.heldout import gap_mm
from draglag.gap.fitting.joint import Fit
from draglag.gap.posterior.judge import Judgement
from draglag.gap.replaying.realised import made
from draglag.gap.results import BY_TAPS, Step
from draglag.messages import message
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import EFFECTS, Effect, effect_class
from draglag.simulation.effects.in_fits import Z95


def waited_s(session: Session, effects: Sequence[Effect]) -> float:
    """Half the longest wait of only taps or only drags."""
    frames = [float(np.mean(np.diff(run.touch.t_s))) for run in session.runs if run.touch.t_s.size > 2]
    frame_s = float(np.median(frames)) if frames else 0.0
    return 0.5 * max((effect.longest_wait_s(frame_s) for effect in effects), default=0.0)


def with_taps(
    session: Session, judgement: Judgement, last: Fit, steps: list[Step], allowed: frozenset[str], p_other: float
) -> tuple[list[Step], Fit]:
    """Steps for a probable difference of taps and drags, and the fit after them. May resize one of ``steps``."""
    parting = [e for name, e in EFFECTS.items() if e.drags_early and name in allowed]
    effects = [made(step.effect, {k: v for k, (v, _) in step.parameters.items()}) for step in steps]
    offset = clock_offset(session, last, effects, waited_s(session, effects), p_other)
    if offset is None or offset.probability < 0.5:
        return [], last
    named = next((k for k, step in enumerate(steps) if effect_class(step.effect).drags_early), None)
    if named is not None:
        early = _lead_of(steps[named])
        beyond = clock_offset(session, last, effects, waited_s(session, effects), p_other, early)
        if beyond is None or beyond.probability < 0.5:
            steps[named] = _sized_by_taps(steps[named], offset)
            return [], last
        offset = beyond
    possible = [e for e in parting if e.parameters[0].lower < e.drags_early * offset.value_s < e.parameters[0].upper]
    if not possible:
        return [], last
    moved = {e.id: _moved_mm(e, e.drags_early * offset.value_s, last) for e in possible}
    likeliest, shares = shares_by_edges(judgement.pool, last, moved)
    if any(effect_class(step.effect).uneven_ages for step in steps):
        # Edges whose positions were of uneven age, repaired or not, cannot identify what moves them by so little.
        shares = dict.fromkeys(moved, 1 / len(moved))
    # Where edges do not decide, the one first that moves none.
    best = min((name for name in shares if shares[name] > DOUBT), key=lambda name: np.ptp(likeliest[name]))
    after = replace(last, residual_mm=last.residual_mm - likeliest[best])
    rivals = tuple(name for name in shares if name != best and shares[name] > DOUBT)
    step = Step(
        best,
        {EFFECTS[best].parameters[0].name: _of_size(offset, EFFECTS[best].drags_early)},
        message("every edge alike"),
        BY_TAPS,
        1 - offset.probability,
        _off_the_asymptote(offset),
        gap_mm(last),
        gap_mm(after),
        offset.probability * sum(shares[e] for e in (best, *rivals)),
        rivals,
        EFFECTS[best].separated_by if rivals else "",
        after,
    )
    return [step], after


def _lead_of(step: Step) -> tuple[float, float]:
    """Lead of drags, and its standard deviation, s."""
    value, (low, high) = next(iter(step.parameters.values()))
    return effect_class(step.effect).drags_early * value, (high - low) / (2 * Z95)


def _sized_by_taps(step: Step, offset: Offset) -> Step:
    """Step sized by taps, too, if they agree."""
    home = effect_class(step.effect)
    parameters = home.with_taps(step.parameters, *_of_size(offset, home.drags_early))
    evidence = message("{evidence}; {taps}", evidence=step.evidence, taps=_off_the_asymptote(offset))
    return replace(step, parameters=parameters or step.parameters, evidence=evidence)


def _of_size(offset: Offset, sign: int) -> tuple[float, tuple[float, float]]:
    """Lead of drags (sign 1) or lag (−1)."""
    low, high = sorted(sign * end for end in offset.ci95_s)
    return sign * offset.value_s, (low, high)


def _off_the_asymptote(offset: Offset) -> str:
    return message("release taps lie {ms:+.1f} ms off the fitted asymptote", ms=1e3 * offset.value_s)


def _moved_mm(effect: type[Effect], value: float, fit: Fit) -> list[FloatArray]:
    """Beyond a constant latency, (m,) of each alternative."""
    options = effect.columns_at((value,), fit.view)
    return [np.asarray(one.columns(fit.view)[:, 0] * value) for one in options] or [np.zeros(fit.residual_mm.size)]
