"""Beam search of probable sets of members."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from draglag.gap import constants
from draglag.gap.fitting.joint import Fit, effects_in, effects_in_law
from draglag.gap.fitting.law_form import LAW_FORM
from draglag.gap.fitting.noise import Components
from draglag.gap.posterior.linear import Linear, Normal
from draglag.gap.posterior.members import Member
from draglag.recording import FloatArray, IntArray
from draglag.simulation.effects import EFFECTS

SCALES_MM = np.array(constants.SLAB_MM)
NEGLIGIBLE = 2 * constants.GIVEN_UP  # nats: hundreds of sets less probable by so much have 1e-4 of the best. Derived


class Explanation(NamedTuple):
    """Set of members. log_mass: prior times evidence, up to a constant; scales_mm: likeliest."""

    members: tuple[int, ...] = ()
    scales_mm: tuple[float, ...] = ()
    log_mass: float = -np.inf

    @property
    def size(self) -> int:
        return len(self.members)


@dataclass(frozen=True)
class Search:
    """Explanations from one linearisation. without: excluded names; most: effects."""

    linear: Linear
    normals: tuple[Normal, ...]
    without: frozenset[str] = frozenset()
    most: int = constants.MOST_EFFECTS
    explanations: tuple[Explanation, ...] = field(repr=False, default=())

    @property
    def levels(self) -> tuple[Components, ...]:
        return tuple(one.levels for one in self.normals)

    @property
    def best(self) -> Explanation:
        return max(self.explanations, key=lambda e: e.log_mass)

    def names(self, explanation: Explanation) -> tuple[str, ...]:
        return tuple(sorted(self.linear.members[i].name for i in explanation.members))


def searched(
    linear: Linear,
    normals: tuple[Normal, ...],
    without: Collection[str] = (),
    most: int = constants.MOST_EFFECTS,
) -> Search:
    """Explanations by beam search."""
    empty = Explanation(log_mass=float(logsumexp([n.base for n in normals])))
    found: dict[tuple[int, ...], Explanation] = {(): empty}
    joining, groups = Joining.of(linear.members), _of_one_width(linear, normals)
    barred = np.array([m.name in without for m in linear.members])

    def with_one_more(front: Sequence[Explanation], allowed: np.ndarray, least: float = -np.inf) -> list[Explanation]:
        new: dict[tuple[int, ...], Explanation] = {}
        for explanation in front:
            inside = list(explanation.members)
            usable = joining.with_all(inside) & allowed
            if np.count_nonzero(joining.effect[inside]) >= most:
                usable &= ~joining.effect
            for one in _extended(linear, normals, explanation, groups, usable, least):
                old = new.get(one.members)
                if old is None or one.log_mass > old.log_mass:
                    new[one.members] = one
        return sorted(new.values(), key=lambda e: -e.log_mass)

    front, own = [empty], own_effects(linear.fit)
    for name in own:  # sets without them are judged at other fits
        ranked = with_one_more(front, np.array([m.name == name for m in linear.members]) & ~barred)
        found |= {e.members: e for e in ranked}
        front = _front(linear, ranked)
    least = -np.inf  # what each member promises alone is asked for, however little it is
    for _ in range(constants.MOST_EFFECTS - len(own)):
        ranked = with_one_more(front, ~barred, least)
        found |= {e.members: e for e in ranked}
        front = _front(linear, ranked)
        best = max(e.log_mass for e in found.values())
        if not front or front[0].log_mass < best - constants.GIVEN_UP:
            break
        least = best - NEGLIGIBLE
    return Search(linear, normals, frozenset(without), most, tuple(found.values()))


def own_effects(fit: Fit) -> tuple[str, ...]:
    """Effects of the fit that its law does not hold: every set judged there has them."""
    of_law = effects_in_law(fit)
    return tuple(name for name in effects_in(fit) if name not in of_law)


def _front(linear: Linear, ranked: list[Explanation]) -> list[Explanation]:
    out: dict[tuple[str, ...], Explanation] = {}
    for explanation in ranked:
        names = tuple(sorted(linear.members[i].name for i in explanation.members))
        if names not in out:
            out[names] = explanation
        if len(out) == constants.BEAM:
            break
    return list(out.values())


@dataclass(frozen=True)
class Joining:
    """Which of c members may be combined.

    name, setting: codes. single: one of its name only. form: the curve's own. of_law, effect: effects on the law, or
    any.
    """

    name: IntArray
    setting: IntArray
    single: np.ndarray
    form: np.ndarray
    of_law: np.ndarray
    effect: np.ndarray

    @classmethod
    def of(cls, members: Sequence[Member]) -> Joining:
        names = {name: k for k, name in enumerate({m.name for m in members})}
        settings = {key: k for k, key in enumerate({(m.name, m.theta) for m in members})}
        return cls(
            np.array([names[m.name] for m in members]),
            np.array([settings[m.name, m.theta] for m in members]),
            np.array([m.named or not m.theta for m in members]),
            np.array([m.name == LAW_FORM for m in members]),
            np.array([_of_the_law(m.name) for m in members]),
            np.array([m.name in EFFECTS for m in members]),
        )

    def with_all(self, inside: Sequence[int]) -> np.ndarray:
        """Members (c,) that may join these."""
        form, of_law = self.form | self.form[inside].any(), self.of_law | self.of_law[inside].any()
        usable: np.ndarray = ~(form & of_law)
        for i in inside:
            again = self.single | self.single[i] | (self.setting == self.setting[i])
            usable &= ~(again & (self.name == self.name[i]))
        return usable


@dataclass(frozen=True)
class OfOneWidth:
    """c members of k columns (c, k), and normal equations, (levels, c, k, k), (levels, c, k)."""

    which: IntArray
    at: IntArray
    gram: FloatArray
    moment: FloatArray


def _of_one_width(linear: Linear, normals: tuple[Normal, ...]) -> list[OfOneWidth]:
    widths = np.array([at.size for at in linear.at])
    out = []
    for k in np.unique(widths):
        which = np.flatnonzero(widths == k)
        at = np.array([linear.at[i] for i in which])
        gram = np.stack([one.gram[at[:, :, None], at[:, None, :]] for one in normals])
        out.append(OfOneWidth(which, at, gram, np.stack([one.moment[at] for one in normals])))
    return out


def _extended(
    linear: Linear,
    normals: tuple[Normal, ...],
    explanation: Explanation,
    groups: list[OfOneWidth],
    usable: np.ndarray,
    least: float,
) -> list[Explanation]:
    """Explanations with one usable member more, of a log mass of at least ``least``."""
    given = _given(linear, normals, explanation)
    gains = np.empty((len(normals), len(linear.members), SCALES_MM.size))
    for group in groups:
        gains[:, group.which] = _gain(given, group)
    each = _log_sum(given.value[:, None, None] + gains, axis=0)  # (members, scales)
    prior = sum(linear.members[i].log_prior for i in explanation.members)
    spent = explanation.size * np.log(SCALES_MM.size)  # of the members before: their scales are at their best
    masses = _log_sum(each, axis=1) - np.log(SCALES_MM.size) + prior - spent + 0.5 * explanation.size
    masses += np.array([member.log_prior for member in linear.members])
    likeliest = SCALES_MM[np.argmax(each, axis=1)]
    out = []
    old, sizes = explanation.members, explanation.scales_mm
    further = np.flatnonzero(usable & (masses >= least))
    for i, scale, mass in zip(*(a.tolist() for a in (further, likeliest[further], masses[further])), strict=True):
        k = bisect(old, i)
        out.append(Explanation((*old[:k], i, *old[k:]), (*sizes[:k], scale, *sizes[k:]), mass))
    return out


def _log_sum(values: FloatArray, axis: int) -> FloatArray:
    top = values.max(axis=axis, keepdims=True)
    return np.asarray(np.log(np.exp(values - top).sum(axis=axis)) + top.squeeze(axis))


def one_law(names: Collection[str]) -> bool:
    """Whether a set lacks the curve's own form or effects on the law."""
    return LAW_FORM not in names or not any(map(_of_the_law, names))


def _of_the_law(name: str) -> bool:
    return name in EFFECTS and EFFECTS[name].of_the_law


def columns_of(linear: Linear, explanation: Explanation) -> tuple[IntArray, FloatArray]:
    """Columns (k,) of an explanation, and their scales (k,)."""
    if not explanation.members:
        return np.zeros(0, np.int64), np.zeros(0)
    at = [linear.at[i] for i in explanation.members]
    return np.concatenate(at), np.repeat(explanation.scales_mm, [a.size for a in at])


@dataclass(frozen=True)
class Given:
    """An explanation of r columns.

    value: (levels,) log evidence. taken (levels, r, q), taken_moment (levels, q): what it takes from normal equations.
    """

    value: FloatArray
    taken: FloatArray
    taken_moment: FloatArray


def _given(linear: Linear, normals: Sequence[Normal], explanation: Explanation) -> Given:
    at, _ = columns_of(linear, explanation)
    value, root, half, scale = _evidence(linear, normals, explanation)
    rows = np.stack([one.gram[at] for one in normals])
    taken = np.asarray(np.linalg.solve(root, scale[:, None] * rows) if at.size else rows, float)
    return Given(value, taken, np.einsum("lrq,lr->lq", taken, half))


def _evidence(
    linear: Linear, normals: Sequence[Normal], explanation: Explanation
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Log evidence (levels,), Cholesky factor, moments through it (levels, r), scales (r,)."""
    at, scale = columns_of(linear, explanation)
    base = np.array([one.base for one in normals])
    if not at.size:
        return base, np.zeros((base.size, 0, 0)), np.zeros((base.size, 0)), scale
    own = np.ix_(at, at)
    inner = np.stack([one.gram[own] for one in normals]) * np.outer(scale, scale) + np.eye(at.size)
    root = np.asarray(np.linalg.cholesky(inner), float)
    moment = np.stack([one.moment[at] for one in normals])
    half = np.asarray(np.linalg.solve(root, (scale * moment)[..., None])[..., 0], float)
    log_det = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return base + 0.5 * np.sum(half**2, axis=1) - log_det, root, half, scale


def _gain(given: Given, group: OfOneWidth) -> FloatArray:
    """Log evidence added by each member, (levels, c, scales)."""
    gram, moment = group.gram, group.moment
    if given.taken.shape[1]:
        taken = np.moveaxis(given.taken[:, :, group.at], 1, 2)  # (levels, c, r, k)
        gram = gram - np.swapaxes(taken, 2, 3) @ taken
        moment = moment - given.taken_moment[:, group.at]
    if group.at.shape[1] == 1:
        values, along = gram[..., 0], moment**2
    else:
        values, axes = np.linalg.eigh(gram)
        along = np.einsum("lckj,lck->lcj", axes, moment) ** 2
    values = np.maximum(values, 0.0)[:, :, None, :] * SCALES_MM[:, None] ** 2
    along = along[:, :, None, :] * SCALES_MM[:, None] ** 2
    return np.asarray(np.sum(0.5 * along / (1 + values) - 0.5 * np.log1p(values), axis=3))


def log_evidence(search: Search, explanation: Explanation) -> FloatArray:
    """Log evidence of an explanation, (levels,)."""
    return _evidence(search.linear, search.normals, explanation)[0]


def sizes_mm(search: Search, explanation: Explanation) -> dict[str, float]:
    """Posterior mean RMS of each name at the likeliest levels; if unnamed, what Eq. 5, a straight beam and the
    explanation's effects cannot move.

    Several members of one name, as jumps at several places, count together.
    """
    linear = search.linear
    at, scale = columns_of(linear, explanation)
    if not at.size:
        return {}
    one = search.normals[int(np.argmax(log_evidence(search, explanation)))]
    information = one.gram[np.ix_(at, at)] + np.diag(scale**-2.0)
    mean = np.linalg.solve(information, one.moment[at])
    inside = {i: linear.members[i] for i in explanation.members}
    effects = [linear.columns[:, linear.at[i]] for i, m in inside.items() if m.named and m.name != LAW_FORM]
    model = np.column_stack([linear.model, *effects])
    moved: dict[str, FloatArray] = {}
    k = 0
    for i in explanation.members:
        own, name = linear.at[i], inside[i].name
        moved[name] = moved.get(name, 0.0) + linear.columns[:, own] @ mean[k : k + own.size]
        if not inside[i].named:
            moved[name] = moved[name] - model @ np.linalg.lstsq(model, moved[name], rcond=None)[0]
        k += own.size
    return {name: float(np.sqrt(np.mean(each**2))) for name, each in moved.items()}
