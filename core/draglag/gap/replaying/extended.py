"""The model of a gap report as a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import draglag
from draglag.curve import FORMS, CurveFit
from draglag.errors import EstimateError
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.law_form import nearest_eq5
from draglag.gap.results import GapReport, Step
from draglag.messages import joined, message
from draglag.model.file import LatencyModel, ModelEffect, Provenance, Shape, model_of
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import effect_class


def law_of_fit(fit: Fit) -> CurveFit:
    """Law of a joint fit as a curve, or its nearest Eq. 5; a plateau's corner is sharp.

    rms_s and between_runs_s: about law plus effects.
    """
    plateau = fit.law.plateau_mm_s > 0
    form = FORMS["double_exponential_plateau" if plateau else "double_exponential"]
    law = nearest_eq5(fit.law, fit.view.speed)
    values = {
        "a1_ms": 1e3 * law.a1_s, "a2_s_per_mm": law.a2_s_mm, "a4_ms": 1e3 * law.a4_s, "a5_s_per_mm": law.a5_s_mm,
        "a7_ms": 1e3 * law.a7_s, "plateau_mm_s": law.plateau_mm_s,
    }  # fmt: skip
    # The fit moves rates by their logarithm and amplitudes in seconds.
    scale = np.array([1e3, law.a2_s_mm, 1e3, law.a5_s_mm, 1e3, 1.0][: 6 if plateau else 5])
    covariance = fit.covariance[: scale.size, : scale.size] * np.outer(scale, scale)
    order = [list(values).index(name) for name in form.names]
    added_s = fit.placed.latency_s - fit.law(fit.placed.speed_mm_s) + _undone_s(fit)  # by effects
    points = [
        (d.estimate.speed_mm_s, d.estimate.latency_s, float(np.mean(added_s[own])))
        for d, own in ((d, (fit.placed.run == k) & fit.use) for k, d in enumerate(fit.runs))
        if own.any()
        and d.estimate is not None
        and d.estimate.latency_s is not None
        and d.estimate.speed_mm_s is not None
    ]
    table = np.array(points, float).reshape(-1, 3)
    left = table[:, 1] - law(table[:, 0]) - table[:, 2]
    speeds = fit.view.speed
    return CurveFit(
        form.name,
        np.array([values[name] for name in form.names]),
        covariance[np.ix_(order, order)],
        float(np.sqrt(np.mean(left**2))) if left.size else 0.0,
        (float(speeds.min()), float(speeds.max())),
        fit.white.components.run_s,
        int(table.shape[0]),
        float("nan"),
        float("nan"),
    )


def _of_the_panel(curve: CurveFit, steps: Sequence[Step]) -> CurveFit:
    """Curve with the clock's offset added to its asymptote."""
    off = next((step for step in steps if effect_class(step.effect).laser_late), None)
    if off is None:
        return curve
    value_s, (low_s, high_s) = off.parameters[effect_class(off.effect).parameters[0].name]
    at = FORMS[curve.form].names.index("a7_ms")
    values, covariance = curve.values.copy(), curve.covariance.copy()
    values[at] += 1e3 * value_s
    covariance[at, at] += (1e3 * (high_s - low_s) / (2 * 1.96)) ** 2
    return replace(curve, values=values, covariance=covariance)


def _undone_s(fit: Fit) -> FloatArray:
    out = np.zeros(len(fit.placed))
    for term in fit.terms:
        out += effect_class(term.effect).undone_s(term, fit.placed)
    return out


def extended_model(session: Session, report: GapReport, created_utc: str = "", input_sha256: str = "") -> LatencyModel:
    """Model of a report. created_utc: ISO 8601. Raises EstimateError without a verdict."""
    if report.last is None:
        raise EstimateError(
            message("{session}: there is no model to save", session=report.session),
            joined("; ", report.missing) or "Try again",
        )
    first, last = report.gap_first_mm, report.gap_last_mm
    provenance = Provenance(
        session=session.name,
        simulated=report.simulated,
        screen=session.screen.name,
        estimator="joint fit of the gap workflow",
        runs=tuple(data.run.id for data in report.last.runs),
        input_sha256=input_sha256,
        created_utc=created_utc,
        software=f"draglag {draglag.__version__}",
        screen_width_mm=session.screen.width_mm,
        screen_height_mm=session.screen.height_mm,
        gap_mm=None if first is None or last is None else (first, last),
        noise_floor_mm=report.noise_floor_mm,
        verdict=report.verdict or "",
    )
    curve = _of_the_panel(law_of_fit(report.last), report.steps)
    effects = [_effect(step, report.last) for step in report.steps]
    return model_of(curve, provenance, effects)


def _effect(step: Step, fit: Fit) -> ModelEffect:
    term = next((t for t in fit.terms if t.effect == step.effect), None)
    made = None if term is None else effect_class(step.effect).shape_in(term, fit)
    shape = None if made is None else Shape(theta=made.theta, sizes=made.sizes, about=made.about)
    return ModelEffect(
        id=step.effect,
        parameters={name: float(value) for name, (value, _) in step.parameters.items()},
        ci95={name: (float(low), float(high)) for name, (_, (low, high)) in step.parameters.items()},
        where=step.where,
        indistinguishable_from=step.indistinguishable_from,
        shape=shape,
    )
