"""Find, name, add, shrink, again: until nothing is left or what is left has no name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.edges import gather
from draglag.gap.finding import Candidate, Finding, find
from draglag.gap.fit import Fit, fit_session
from draglag.gap.heldout import floor_mm, gap_mm, shrinks, shrinks_with
from draglag.gap.model import base_prior
from draglag.gap.naming import PLATEAU, TOO_CLOSE, UNNAMED_MARGIN, Name, gained, name, refit
from draglag.gap.parameters import parameters_of, where_of
from draglag.gap.separate import ALWAYS_TOGETHER, EXTRA_RUN, clock_offset, not_seen, what_is_missing, which_drift
from draglag.gap.signatures import SIGNATURES, shape_free
from draglag.gap.soundness import excess_scatter
from draglag.gap.streams import StreamEffect, inspect
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS

MOST_EFFECTS = 6
NEARLY_ALL = 0.8  # of what a free shape explains: the shape is then the name's, and the rest a matter of detail
ESTIMATED = {"acceleration", "normal_acceleration"}  # known from smoothed traces only; held-out runs decide there
CERTAIN = 80.0  # a structure this strong is there, whatever the held-out runs make of it
UNEVEN_AGES = {"sample_hold", "timestamp_quantisation", "frame_batching", "loss_of_contact"}  # they scatter edges
CLOSES = 0.5  # of the gap: a name that closes so much of it is not the model's own search that had stopped short
SAME_MODEL_BETTER = 6.0  # twice the log-likelihood by which a second start beats the first
Progress = Callable[[float, str], None]

COVARIATE = {
    "clock_drift": "session_time", "thermal_drift": "session_time", "low_speed_plateau": "speed", "scan_skew": "x",
    "spatial_warp": "x", "beam_wedge": "x", "pitch_ripple": "x", "laser_hysteresis": "kind_of_edge",
    "beam_width": "kind_of_edge", "direction_asymmetry": "direction", "second_filter_mode": "speed",
    "lagging_law": "acceleration", "acceleration_lag": "acceleration", "smoothing_shrink": "normal_acceleration",
    "clock_offset": "taps", "sample_hold": "host_tick", "frame_batching": "frame", "timestamp_quantisation": "frame",
    "frame_drop": "frame", "loss_of_contact": "frame", "laser_bounce": "kind_of_edge",
}  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One effect added. parameters: name → (value, (low, high)); gaps on held-out runs, mm."""

    effect: str
    parameters: dict[str, tuple[float, tuple[float, float]]]
    where: str
    covariate: str
    p_value: float
    evidence: str
    gap_before_mm: float
    gap_after_mm: float
    indistinguishable_from: tuple[str, ...] = ()
    extra_run: str = ""
    fit: Fit | None = field(default=None, repr=False)

    def to_dict(self) -> dict[str, object]:
        gain = 1 - self.gap_after_mm / self.gap_before_mm if self.gap_before_mm > 0 else 0.0
        return {
            "effect": self.effect,
            "indistinguishable_from": list(self.indistinguishable_from),
            "parameters": {k: {"value": v, "ci95": list(ci)} for k, (v, ci) in self.parameters.items()},
            "where": self.where,
            "covariate": self.covariate,
            "evidence": {"p_value": self.p_value, "held_out_gain": gain, "text": self.evidence},
            "gap_before_mm": self.gap_before_mm,
            "gap_after_mm": self.gap_after_mm,
            "extra_run": self.extra_run,
        }


@dataclass(frozen=True)
class GapReport:
    """The workflow's result. verdict: explained | no_gap | unexplained, or None with ``missing`` for a poor session."""

    session: str
    verdict: str | None
    steps: tuple[Step, ...] = ()
    noise_floor_mm: float | None = None
    gap_first_mm: float | None = None
    gap_last_mm: float | None = None
    unexplained_by: str | None = None
    p_value: float | None = None
    missing: tuple[str, ...] = ()
    not_seen: dict[str, str] = field(default_factory=dict)
    first: Fit | None = field(default=None, repr=False)
    last: Fit | None = field(default=None, repr=False)
    finding: Finding | None = field(default=None, repr=False)

    def to_dict(self) -> dict[str, object]:
        """The design's ``gap --json`` (section 5)."""
        return {
            "session": self.session,
            "verdict": self.verdict,
            "noise_floor_mm": self.noise_floor_mm,
            "steps": [step.to_dict() for step in self.steps],
            "unexplained_by": self.unexplained_by,
            "gap_first_mm": self.gap_first_mm,
            "gap_last_mm": self.gap_last_mm,
            "p_value": self.p_value,
            "missing": list(self.missing),
            "not_seen": dict(self.not_seen),
        }


def close_gap(
    session: Session,
    max_effects: int = MOST_EFFECTS,
    candidates: Iterable[str] | None = None,
    progress: Progress | None = None,
) -> GapReport:
    """Run the workflow on a session.

    Args:
        candidates: effect ids that may be named; None = the whole library.

    Never raises for a poor session: the report says what is missing instead of giving a verdict.
    """
    allowed = frozenset(EFFECTS) if candidates is None else frozenset(candidates)
    tell = progress or (lambda fraction, text: None)
    missing = what_is_missing(session)
    if missing:
        return GapReport(session.name, None, missing=missing)
    tell(0.05, "streams")
    seen, repaired = inspect(session)
    seen = tuple(s for s in seen if s.effect in allowed)
    if not seen:
        repaired = session
    try:
        runs = gather(repaired)
        tell(0.15, "fitting the present model")
        fit = fit_session(repaired, runs)
    except (EstimateError, np.linalg.LinAlgError, ValueError) as problem:
        return GapReport(session.name, None, missing=(str(problem),))
    steps = list(_stream_steps(session, seen, fit))
    first_mm = steps[0].gap_before_mm if steps else gap_mm(fit)
    first = fit
    plateau = False
    ages = bool({s.effect for s in seen} & UNEVEN_AGES)
    finding = find(fit, without=_left_out(allowed) | _beside((), ages))
    unexplained: Candidate | None = None
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
        if better is not None and not closes and gained(fit, better) > SAME_MODEL_BETTER:
            # The model itself had not found its best point: an effect must not be named for that.
            retries -= 1
            fit = better
            first, first_mm = (first, first_mm) if steps else (fit, gap_mm(fit))
            finding = find(fit, without=_left_out(allowed) | _beside((s.effect for s in steps), ages))
            continue
        nearly = bool(names) and unnamed is not None and names[0].gain > NEARLY_ALL * unnamed.score
        if (
            unnamed is not None
            and not nearly
            and not (names and _path_closes(repaired, names[0], allowed, plateau, max_effects))
        ):
            unexplained = unnamed
            break
        if not names:
            unexplained = _still_there(fit, finding)
            break
        step = _step(session, names, finding, allowed)
        plateau = plateau or names[0].effect == PLATEAU
        fit = names[0].fit
        steps.append(step)
        fit, steps = _without_proxies(repaired, fit, steps)
        finding = find(fit, without=_left_out(allowed) | _beside((s.effect for s in steps), ages))
    steps = [_settled(step, fit) for step in steps]
    if unexplained is None and finding.significant:
        unexplained = _still_there(fit, finding)
    if unexplained is None and not ages:
        unexplained = excess_scatter(fit)
    if unexplained is None:
        steps += _offset_step(session, fit, steps, allowed)
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
        None if unexplained is None else _covariate(unexplained),
        finding.p_value,
        (),
        not_seen(session, fit),
        first,
        fit,
        finding,
    )


def _beside(steps: Iterable[str], ages: bool) -> set[str]:
    """Effects that cannot be told beside those named: their evidence is what these leave themselves."""
    out = set(steps)
    if "smoothing_shrink" in out:
        out.add("lagging_law")  # a low-pass delays, and the speed that counts with it
    if ages:
        out |= {"lagging_law", "acceleration_lag"}  # positions of uneven age beat with the motion
    return out


def _left_out(allowed: frozenset[str]) -> set[str]:
    out = {e for e in SIGNATURES if e not in allowed}
    if "thermal_drift" in allowed:
        out.discard("clock_drift")  # they share one signature; taps decide on the name
    if "scale_error" in allowed:
        out.discard("beam_width")
    return out


def _path_closes(session: Session, start: Name, allowed: frozenset[str], plateau: bool, most: int) -> bool:
    """Whether named effects, added one by one from a first, leave nothing: then a smooth term was only their sum."""
    fit, used = start.fit, {start.effect}
    plateau = plateau or start.effect == PLATEAU
    for _ in range(min(most, 2)):
        finding = find(fit, without=_left_out(allowed) | used)
        if not finding.significant:
            return True
        names, unnamed = name(session, fit, finding, allowed, plateau)
        if unnamed is not None or not names:
            return False
        fit = names[0].fit
        used.add(names[0].effect)
        plateau = plateau or names[0].effect == PLATEAU
    return not find(fit, without=_left_out(allowed) | used).significant


def _step(session: Session, names: list[Name], finding: Finding, allowed: frozenset[str]) -> Step:
    best = names[0]
    effect = best.effect
    close = tuple(n.effect for n in names[1:] if best.gain - n.gain < TOO_CLOSE)
    p_value = next((c.p_value for c in finding.candidates if c.effect == effect), finding.p_value)
    evidence = f"deviance falls by {best.gain:.0f} after its price"
    together = tuple(e for e in ALWAYS_TOGETHER.get(effect, ()) if e in allowed)
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
        COVARIATE.get(effect, ""),
        p_value,
        evidence,
        best.gap_before_mm,
        best.gap_after_mm,
        tuple(dict.fromkeys((*together, *close))),
        EXTRA_RUN.get(effect, "") if together or close else "",
        best.fit,
    )


TERM_OF = {"thermal_drift": "clock_drift", "scale_error": "beam_width"}


def _without_proxies(session: Session, fit: Fit, steps: list[Step]) -> tuple[Fit, list[Step]]:
    """Look at earlier names again beside the newest: one that only stood in for it is dropped."""
    for term in list(fit.terms[:-1]):
        at = [t.effect for t in fit.terms]
        others = [t for t in fit.terms if t.effect != term.effect]
        first = base_prior(fit.law).size + sum(len(t.sizes) for t in fit.terms[: at.index(term.effect)])
        own = slice(first, first + len(term.sizes))
        sizes = np.array(term.sizes)
        wald = float(sizes @ np.linalg.pinv(fit.covariance[own, own]) @ sizes)
        if wald > 40 * sizes.size:
            continue
        without = refit(session, fit, others, fit.law.plateau_mm_s > 0)
        if without is None:
            continue
        if -gained(fit, without) < 8 * sizes.size:
            fit = without
            steps = [s for s in steps if TERM_OF.get(s.effect, s.effect) != term.effect]
    return fit, steps


def _settled(step: Step, fit: Fit) -> Step:
    """The step with its numbers from the final fit, beside all other effects."""
    numbers = parameters_of(step.effect, fit)
    return replace(step, parameters=numbers or step.parameters)


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
            {item.parameter: (item.value, item.ci95)},
            item.where,
            COVARIATE.get(item.effect, ""),
            1e-9,
            item.evidence,
            before if k == 0 else after,
            after,
        )


def _offset_step(session: Session, fit: Fit, steps: list[Step], allowed: frozenset[str]) -> list[Step]:
    if "clock_offset" not in allowed:
        return []
    creep = 0.0
    if any(s.effect == "thermal_drift" for s in steps):
        creep = -next((t.sizes[0] for t in fit.terms if t.effect == "clock_drift"), 0.0)
    held = {"sample_hold", "frame_batching", "timestamp_quantisation"} & {s.effect for s in steps}
    offset = clock_offset(session, fit, creep)
    if offset is None or held:
        return []
    # A low-pass delays as well as it shrinks: taps then lie below the asymptote by about its time constant.
    if any(s.effect == "smoothing_shrink" for s in steps) and offset.value_s < 0:
        return []
    after = gap_mm(fit)
    before = float(np.sqrt(after**2 + np.mean((fit.view.v_across * offset.value_s) ** 2)))
    return [
        Step(
            "clock_offset",
            {"offset_s": (offset.value_s, offset.ci95_s)},
            "every edge alike",
            "taps",
            offset.p_value,
            f"release taps lie {1e3 * offset.value_s:+.1f} ms off the fitted asymptote",
            before,
            after,
        )
    ]


def _still_there(fit: Fit, finding: Finding) -> Candidate | None:
    """The strongest structure left that held-out runs confirm and that is worth more than its price."""
    smooth = shape_free(fit.view)
    for candidate in finding.significant:
        if candidate.score <= UNNAMED_MARGIN:
            return None
        if candidate.effect is None and candidate.score > CERTAIN and candidate.covariate not in ESTIMATED:
            return candidate
        if candidate.effect is None and shrinks_with(fit, smooth[candidate.covariate, candidate.role]):
            return candidate
    return None


def _covariate(candidate: Candidate) -> str:
    return candidate.covariate or COVARIATE.get(candidate.effect or "", candidate.effect or "")


def with_session_name(report: GapReport, text: str) -> GapReport:
    """The report under another session name (a file's)."""
    return replace(report, session=text)
