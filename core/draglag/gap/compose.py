"""The workflow's verbs for use by hand: ``find``, ``name``, ``Model.with_effect``, ``shrinkage``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from draglag.errors import DataError, EstimateError, message_of
from draglag.gap.constants import DOUBT, PREDICTS_NATS, SEED, STATED_AT_MOST
from draglag.gap.correction import without_effects
from draglag.gap.fitting.heldout import floor_mm, gap_mm, shrinks, squares_by_run
from draglag.gap.fitting.joint import Fit, effects_in, fit_session
from draglag.gap.fitting.law_form import LAW_FORM
from draglag.gap.fitting.model import Geometry, LawParameters
from draglag.gap.fitting.signatures import COLUMNS
from draglag.gap.fitting.state import Term
from draglag.gap.posterior.answer import answer_of
from draglag.gap.posterior.judge import grown, judged
from draglag.gap.posterior.misfit import parameters_with_misfit
from draglag.gap.posterior.pool import Pool, compared
from draglag.gap.replaying.realised import made
from draglag.gap.results import Step
from draglag.gap.session_check import times_out_of_order
from draglag.gap.steps import deviance_gained, step_of
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stamps import StreamEffect
from draglag.gap.traces.run_data import gather
from draglag.gap.traces.searched import searched
from draglag.latency.conduct import kept_runs
from draglag.messages import message
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, column_of, effect_class, known_effects
from draglag.system.blas import one_blas_thread


def shown_by_streams(effect_id: str) -> bool:
    """Whether it is repaired in streams, not fitted to edges."""
    return effect_class(effect_id).undone_in == "stream"


@dataclass(frozen=True)
class Model:
    """Law, beam and effects.

    effects: ids, fitted. held: id → parameters, removed from the session. law, geometry, terms: of the last fit. of:
    the session fitted.
    """

    effects: tuple[str, ...] = ()
    held: tuple[tuple[str, tuple[tuple[str, float], ...]], ...] = ()
    law: LawParameters | None = None
    geometry: Geometry | None = None
    terms: tuple[Term, ...] = ()
    fit: Fit | None = field(default=None, repr=False, compare=False)
    of: tuple[object, ...] = field(default=(), repr=False, compare=False)

    def with_effect(self, effect_id: str, values: Mapping[str, float] | None = None) -> Model:
        """Model with one more effect, fitted or held at ``values``.

        Raises DataError for an effect that is unknown, present or cannot be held, or for impossible values.
        """
        if effect_id not in EFFECTS:
            raise DataError(
                message("unknown effect '{effect}'", effect=effect_id),
                message("Known are {effects}", effects=", ".join(EFFECTS)),
            )
        if effect_id in self.effects or effect_id in dict(self.held):
            raise DataError(message("{effect} is in the model already", effect=effect_id), "Add another effect")
        if values is None:
            if column_of(effect_id) not in COLUMNS and not shown_by_streams(effect_id):
                raise DataError(
                    message("{effect} cannot be fitted to edges", effect=effect_id),
                    "Give its values, or add another effect",
                )
            return replace(self, effects=(*self.effects, effect_id))
        known = {spec.name for spec in EFFECTS[effect_id].parameters}
        unknown = set(values) - known
        if unknown:
            raise DataError(
                message("{effect} has no parameter '{parameter}'", effect=effect_id, parameter=min(unknown)),
                message("Known are {names}", names=", ".join(sorted(known))),
            )
        _check_held(effect_id, values)
        return replace(self, held=(*self.held, (effect_id, tuple(sorted(values.items())))))

    def without_effect(self, effect_id: str) -> Model:
        """Model without one effect. Raises DataError if it has none of that id."""
        if effect_id not in self.effects and effect_id not in dict(self.held):
            raise DataError(message("{effect} is not in the model", effect=effect_id), "Take out one that is")
        effects = tuple(e for e in self.effects if e != effect_id)
        return Model(effects, tuple(item for item in self.held if item[0] != effect_id))

    @property
    def parameters(self) -> dict[str, dict[str, tuple[float, tuple[float, float]]]]:
        """Effect → parameter → (value, 95 % interval), fitted effects only."""
        if self.fit is None:
            return {}
        return {
            effect: parameters_with_misfit(effect, self.fit) for effect in self.effects if not shown_by_streams(effect)
        }


@dataclass(frozen=True)
class Gap:
    """Where a session and a model disagree.

    pool: explanations of the rest. streams: effects that streams show. gap_mm: RMS on held-out runs; noise_floor_mm: by
    noise alone.
    """

    session: Session = field(repr=False)
    model: Model
    fit: Fit = field(repr=False)
    pool: Pool = field(repr=False)
    streams: tuple[StreamEffect, ...]
    gap_mm: float
    noise_floor_mm: float

    @property
    def probability(self) -> float:
        """Posterior probability of anything beyond model, curve's form and noise."""
        inside = set(self.pool.emptiest)
        return sum(p for names, p in self.pool.probabilities().items() if set(names) - inside - {LAW_FORM})

    @property
    def members(self) -> dict[str, float]:
        """Effect id, or ``?covariate:role`` if unnamed → probability, down to 0.1."""
        names = {name for found in self.pool.found for name in found} - set(self.pool.emptiest) - {LAW_FORM}
        each = {name: self.pool.probability_of(name) for name in names}
        return {n: p for n, p in sorted(each.items(), key=lambda item: -item[1]) if p >= DOUBT}


@dataclass(frozen=True)
class Shrinkage:
    """Change of the gap on held-out runs.

    change_ci95_mm: bootstrap over runs. improves: by more than ``SHRINKS_BY``. verdict: shrinks | open | grows.
    """

    before_mm: float
    after_mm: float
    noise_floor_mm: float
    change_ci95_mm: tuple[float, float]
    deviance_gained: float
    improves: bool

    @property
    def verdict(self) -> str:
        low, high = self.change_ci95_mm
        # Runs may agree by chance on an effect that their edges do not ask for at all.
        if self.improves and high < 0 and not 0.5 * self.deviance_gained < PREDICTS_NATS:
            return "shrinks"
        return "grows" if low > 0 else "open"

    def to_dict(self) -> dict[str, object]:
        return {
            "gap_before_mm": self.before_mm,
            "gap_after_mm": self.after_mm,
            "noise_floor_mm": self.noise_floor_mm,
            "change_ci95_mm": list(self.change_ci95_mm),
            "deviance_gained": self.deviance_gained,
            "verdict": self.verdict,
        }


@one_blas_thread
def find(session: Session, model: Model | None = None) -> Gap:
    """Gap of a session and a model fitted to it, without runs that ``analyze`` leaves out.

    A model of this session keeps its edges, so that gaps can be compared.

    Raises EstimateError if the session cannot carry the model.
    """
    model = model or Model()
    session, _, estimates = kept_runs(session, estimates=searched(session))
    start = model.fit if model.of == _of(session) else None
    disorder = times_out_of_order(session)
    if disorder:
        raise EstimateError(
            message("{session}: {problem}", session=session.name, problem=disorder), "Export and import it"
        )
    repairs = any(map(shown_by_streams, model.effects))
    try:
        in_streams, repaired = inspect(session)
        streams = tuple(s for s in in_streams if s.effect not in model.effects)
        ready = _without_held(repaired if repairs else session, model.held)
        if start is None or any(map(shown_by_streams, model.effects[-1:])) or model.held:
            start = fit_session(ready, gather(ready, estimates))
        fit = start
        unsure = any(effect_class(s.effect).uneven_ages and not (s.undone and repairs) for s in in_streams)
        fitted = [column_of(effect) for effect in model.effects if not shown_by_streams(effect)]
        for effect in dict.fromkeys(fitted):
            if effect not in effects_in(fit):
                fit = with_one_more(ready, fit, effect, unsure)
        pool = compared([fit], frozenset(EFFECTS), unsure)
    except (np.linalg.LinAlgError, ValueError) as problem:
        raise EstimateError(
            message(
                "{session}: the model cannot be fitted: {problem}", session=session.name, problem=message_of(problem)
            ),
            "Remove an effect from the model",
        ) from None
    found = replace(model, law=fit.law, geometry=fit.geometry, terms=fit.terms, fit=fit, of=_of(session))
    return Gap(ready, found, fit, pool, streams, gap_mm(fit), floor_mm(fit))


def with_one_more(session: Session, fit: Fit, effect: str, unsure_ages: bool) -> Fit:
    """Refit with one more effect. Raises EstimateError if the session cannot carry it."""
    pool = compared([fit], {effect}, unsure_ages, most=1)
    wanted = tuple(sorted({*effects_in(fit), effect}))
    fits = grown(session, {effects_in(fit): fit}, pool, wanted)
    if wanted not in fits:
        raise EstimateError(
            message("{session}: the model cannot be fitted with {effect}", session=session.name, effect=effect),
            "Choose another effect",
        )
    return fits[wanted]


@one_blas_thread
def name(gap: Gap, candidates: Collection[str] | str | None = None) -> tuple[Step, ...]:
    """Effects that explain a gap, most probable first; those of streams come alone, to be repaired first.

    Raises DataError for an unknown candidate.
    """
    allowed = known_effects(candidates)
    shown = tuple(_stream_step(item, gap) for item in gap.streams if item.effect in allowed)
    if shown:
        return shown
    judgement = judged(gap.session, gap.fit, allowed, gap.pool.unsure_ages)
    inside = effects_in(gap.fit)
    answer = answer_of(judgement.pool)
    out = []
    for effect in answer.effects:
        wanted = tuple(sorted({*inside, effect}))
        fits = judgement.fits
        if effect in inside or wanted == inside:
            continue
        if wanted not in fits:
            fits = grown(gap.session, fits, judgement.pool, wanted)
        if wanted in fits:
            out.append(step_of(gap.session, judgement, answer, allowed, effect, judgement.base, fits[wanted]))
    return tuple(sorted(out, key=lambda step: -step.probability))


@one_blas_thread
def shrinkage(before: Gap, after: Gap) -> Shrinkage:
    """Change of the held-out gap. Raises DataError for two sessions."""
    if _of(before.session) != _of(after.session):
        raise DataError(
            message(
                "the gaps are of two sessions, {one} and {other}", one=before.session.name, other=after.session.name
            ),
            "Compare two models on the same session",
        )
    old, new = squares_by_run(before.fit), squares_by_run(after.fit)
    shared = sorted(old.keys() & new.keys())
    draws = np.random.default_rng(SEED).integers(0, max(len(shared), 1), (1000, max(len(shared), 1)))
    interval = (float("nan"), float("nan"))
    if len(shared) > 1:
        table = np.array([(*old[k], *new[k]) for k in shared])[draws].sum(axis=1)
        change = np.sqrt(table[:, 2] / table[:, 3]) - np.sqrt(table[:, 0] / table[:, 1])
        interval = (float(np.quantile(change, 0.025)), float(np.quantile(change, 0.975)))
    return Shrinkage(
        before.gap_mm,
        after.gap_mm,
        after.noise_floor_mm,
        interval,
        float(deviance_gained(before.fit, after.fit)) if before.fit.use.size == after.fit.use.size else float("nan"),
        shrinks(before.fit, after.fit),
    )


def _check_held(effect_id: str, values: Mapping[str, float]) -> None:
    if effect_class(effect_id).undone_in not in ("laser", "touch"):
        raise DataError(
            message("{effect} cannot be held at a value", effect=effect_id), "Leave its values out: then it is fitted"
        )
    specs = EFFECTS[effect_id].parameters
    if not values:
        names = ", ".join(spec.name for spec in specs)
        raise DataError(
            message("{effect} has no value to be held at", effect=effect_id),
            message("Give {names}, or leave values out: it is fitted", names=names),
        )
    for spec in specs:
        value = values.get(spec.name, spec.typical)
        if isinstance(value, bool) or not isinstance(value, int | float | np.number):
            raise DataError(
                message(
                    "{effect} cannot be held at {parameter} {value}",
                    effect=effect_id,
                    parameter=spec.name,
                    value=repr(value),
                ),
                "Give a number",
            )
        if not spec.lower <= value <= spec.upper:  # nor is nan
            bounds = message("{low:g} to {high:g} {unit}", low=spec.lower, high=spec.upper, unit=spec.unit)
            raise DataError(
                message(
                    "{effect} cannot be held at {parameter} {value:g}",
                    effect=effect_id,
                    parameter=spec.name,
                    value=value,
                ),
                message("Give {bounds}", bounds=bounds),
            )


def _without_held(session: Session, held: Sequence[tuple[str, tuple[tuple[str, float], ...]]]) -> Session:
    if not held:
        return session
    law = fit_session(session, gather(session)).law
    return without_effects(session, [made(name, dict(values)) for name, values in held], law)


def _of(session: Session) -> tuple[object, ...]:
    """What repairs of a session leave unchanged."""
    return session.name, session.started_utc, tuple((run.id, run.start_s) for run in session.runs)


def _stream_step(item: StreamEffect, gap: Gap) -> Step:
    parameters = item.parameters
    covariate = effect_class(item.effect).follows
    return Step(
        item.effect, parameters, item.where, covariate, 1e-9, item.evidence, gap.gap_mm, gap.gap_mm, STATED_AT_MOST
    )
