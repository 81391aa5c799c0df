"""Possible members of an explanation."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from draglag.gap import constants
from draglag.gap.fitting.joint import Fit, effects_in
from draglag.gap.fitting.law_form import LAW_FORM, FlexibleLaw, basis, knots_over
from draglag.gap.fitting.line_gains import line_gains
from draglag.gap.fitting.noise import Scatter
from draglag.gap.fitting.signatures import COLUMNS, jumps, shape_free
from draglag.gap.proposing.proposals import possible_in
from draglag.recording import FloatArray
from draglag.simulation.effects import column_of, effect_class

UNNAMED = "?"


@dataclass(frozen=True)
class Member:
    """Possible part of an explanation. name: effect id, ``law_form`` or ``?covariate:role``; columns: (m, k)."""

    name: str
    theta: tuple[float, ...]
    columns: FloatArray
    log_prior: float

    @property
    def named(self) -> bool:
        return not self.name.startswith(UNNAMED)

    @property
    def covariate(self) -> str:
        return self.name.removeprefix(UNNAMED).partition(":")[0]


def members_of(fit: Fit, parts: Scatter, allowed: Collection[str]) -> list[Member]:
    """Members that may be added to a fit."""
    return [*_effects(fit, parts, allowed), *_smooth(fit), *_jumps(fit), *_levels(fit), _law_form(fit)]


def _effects(fit: Fit, parts: Scatter, allowed: Collection[str]) -> list[Member]:
    """Effects, without those in the fit that refits improve."""
    gains = line_gains(fit, parts)
    own, columns = effects_in(fit), {column_of(effect) for effect in allowed}
    out = []
    for effect, make in COLUMNS.items():
        if effect not in columns or (effect in own and effect_class(effect).refitted_by):
            continue
        if not possible_in(fit, effect):
            continue
        made = make(fit.view, gains)
        for one in made:
            share = 1 / len(made) if one.share is None else one.share
            out.append(Member(effect, one.theta, one.columns(fit.view), float(np.log(constants.P_EFFECT * share))))
    return out


def smooth_columns(fit: Fit) -> dict[tuple[str, str], FloatArray]:
    """(covariate, role) → columns, except the curve's form."""
    return {key: columns for key, columns in shape_free(fit.view).items() if key != ("speed", "latency")}


def _smooth(fit: Fit) -> list[Member]:
    prior = float(np.log(constants.P_SMOOTH))
    return [
        Member(f"{UNNAMED}{covariate}:{role}", (), columns, prior)
        for (covariate, role), columns in smooth_columns(fit).items()
    ]


def _jumps(fit: Fit) -> list[Member]:
    found = jumps(fit.view)
    count: dict[tuple[str, str], int] = {}
    for covariate, role, _ in found:
        count[covariate, role] = count.get((covariate, role), 0) + 1
    return [
        Member(
            f"{UNNAMED}{covariate}:{role}",
            made.theta,
            made.columns(fit.view),
            float(np.log(constants.P_JUMP / count[covariate, role])),
        )
        for covariate, role, made in found
    ]


def _levels(fit: Fit) -> list[Member]:
    prior = float(np.log(constants.P_SMOOTH))
    lever = fit.view.v_across * fit.view.stretch
    ids = np.unique(fit.run_index)
    runs = (fit.run_index[:, None] == ids).astype(float)
    levels = [k for k in ids if fit.runs[k].steady]  # that of a run of changing speed is left open by the noise
    single = float(np.log(constants.P_JUMP / max(len(levels), 1)))
    alone = [
        Member(f"{UNNAMED}run:latency", (float(k),), -(lever * (fit.run_index == k))[:, None], single) for k in levels
    ]
    v, a = fit.placed.v_mm_s[fit.use], fit.placed.a_mm_s2[fit.use]
    bends = v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0]
    turn = np.ones(lever.size)
    for k in np.unique(fit.run_index):
        own = fit.run_index == k
        turn[own] = 1.0 if np.median(bends[own]) >= 0 else -1.0
    return [
        *alone,
        Member(f"{UNNAMED}run:latency", (), -lever[:, None] * runs, prior),
        Member(f"{UNNAMED}kind_of_edge:latency", (), -(lever * (fit.view.rising - 0.5))[:, None], prior),
        Member(f"{UNNAMED}kind_of_edge:width", (), 0.5 * fit.view.side[:, None], prior),
        Member(f"{UNNAMED}direction:latency", (), -(lever * np.sign(fit.view.v_across))[:, None], prior),
        Member(f"{UNNAMED}turn:latency", (), -(lever * turn)[:, None], prior),
        Member(f"{UNNAMED}turn:offset", (), turn[:, None], prior),
    ]


def _law_form(fit: Fit) -> Member:
    knots = fit.law.knots if isinstance(fit.law, FlexibleLaw) else knots_over(fit.view.speed)
    columns = -(fit.view.v_across * fit.view.stretch)[:, None] * basis(fit.view.speed, knots)
    return Member(LAW_FORM, knots, columns, float(np.log(constants.P_LAW_FORM)))


def of_unit_rms(columns: FloatArray) -> FloatArray:
    """Columns (m, k) scaled together to 1 mm RMS."""
    return np.asarray(columns / max(float(np.sqrt(np.mean(columns**2) * columns.shape[1])), 1e-12))
