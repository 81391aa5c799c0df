"""Which sets of members explain a linearised session, and how probable each is.

The evidence of one more member given a set is a closed form in the eigenvalues of its own normal equations, given the
set: all members and all their scales are weighed at once.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from draglag.gap import constants
from draglag.gap.fitting.law_form import LAW_FORM
from draglag.gap.posterior.linear import Linear, Normal
from draglag.gap.posterior.members import Member
from draglag.recording import FloatArray, IntArray
from draglag.simulation.effects import EFFECTS

SCALES_MM = np.array(constants.SLAB_MM)


@dataclass(frozen=True)
class Explanation:
    """A set of members. log_mass: log prior times evidence, up to a constant of all explanations; scales_mm: where each
    member's size is likeliest."""

    members: tuple[int, ...] = ()
    scales_mm: tuple[float, ...] = ()
    log_mass: float = -np.inf

    @property
    def size(self) -> int:
        return len(self.members)


@dataclass(frozen=True)
class Search:
    """All explanations looked at from one linearisation, under some levels of the noise."""

    linear: Linear
    normals: tuple[Normal, ...]
    explanations: tuple[Explanation, ...] = field(repr=False, default=())

    @property
    def best(self) -> Explanation:
        return max(self.explanations, key=lambda e: e.log_mass)

    def names(self, explanation: Explanation) -> tuple[str, ...]:
        return tuple(sorted(self.linear.members[i].name for i in explanation.members))


def searched(
    linear: Linear,
    normals: tuple[Normal, ...],
    without: Collection[str] = (),
    most: int = constants.MOST_MEMBERS,
) -> Search:
    """Explanations of up to ``MOST_MEMBERS`` members, by beam search. without: names that are impossible; most: effects
    that may be named."""
    empty = Explanation(log_mass=float(logsumexp([n.base for n in normals])))
    found: dict[tuple[int, ...], Explanation] = {(): empty}
    groups = _of_one_width(linear)
    front = [empty]
    barred = np.array([m.name in without for m in linear.members])
    effects = np.array([m.name in EFFECTS for m in linear.members])
    for _ in range(constants.MOST_MEMBERS):
        new: dict[tuple[int, ...], Explanation] = {}
        for explanation in front:
            full = sum(linear.members[i].name in EFFECTS for i in explanation.members) >= most
            for one in _extended(linear, normals, explanation, groups, barred | effects if full else barred):
                old = new.get(one.members)
                if old is None or one.log_mass > old.log_mass:
                    new[one.members] = one
        ranked = sorted(new.values(), key=lambda e: -e.log_mass)
        found |= {e.members: e for e in ranked}
        front = _front(linear, ranked)
        best = max(e.log_mass for e in found.values())
        if not front or front[0].log_mass < best - constants.GIVEN_UP:
            break
    return Search(linear, normals, tuple(found.values()))


def _front(linear: Linear, ranked: list[Explanation]) -> list[Explanation]:
    """The best explanations of different names."""
    out: dict[tuple[str, ...], Explanation] = {}
    for explanation in ranked:
        names = tuple(sorted(linear.members[i].name for i in explanation.members))
        if names not in out:
            out[names] = explanation
        if len(out) == constants.BEAM:
            break
    return list(out.values())


def _of_one_width(linear: Linear) -> list[tuple[IntArray, IntArray]]:
    """Members (c,) of each number of columns k, and which columns of all they are, (c, k)."""
    widths = np.array([at.size for at in linear.at])
    return [
        (np.flatnonzero(widths == k), np.array([linear.at[i] for i in np.flatnonzero(widths == k)]))
        for k in np.unique(widths)
    ]


def _extended(
    linear: Linear,
    normals: tuple[Normal, ...],
    explanation: Explanation,
    groups: list[tuple[IntArray, IntArray]],
    barred: np.ndarray,
) -> list[Explanation]:
    """The explanation with each further member, whose size is integrated over its scales."""
    inside = [linear.members[i] for i in explanation.members]
    usable = np.array([_may_join(m, inside) for m in linear.members]) & ~barred
    gains = np.empty((len(normals), len(linear.members), SCALES_MM.size))
    bases = np.empty(len(normals))
    for n, one in enumerate(normals):
        bases[n], given = _given(linear, one, explanation)
        for which, at in groups:
            gains[n, which] = _gain(one, given, at)
    each = logsumexp(bases[:, None, None] + gains, axis=0)  # (members, scales)
    prior = sum(linear.members[i].log_prior for i in explanation.members)
    spent = explanation.size * np.log(SCALES_MM.size)  # of the members before: their scales are at their best
    masses = logsumexp(each, axis=1) - np.log(SCALES_MM.size) + prior - spent + 0.5 * explanation.size
    out = []
    for i in np.flatnonzero(usable):
        order = np.argsort(np.array([*explanation.members, int(i)]))
        members = np.array([*explanation.members, i])[order]
        scales = np.array([*explanation.scales_mm, SCALES_MM[int(np.argmax(each[i]))]])[order]
        mass = float(masses[i] + linear.members[i].log_prior)
        out.append(Explanation(tuple(int(k) for k in members), tuple(float(s) for s in scales), mass))
    return out


def one_law(names: Collection[str]) -> bool:
    """Whether names make one statement about the curve: a form of its own leaves nothing to an effect on the law."""
    return LAW_FORM not in names or not any(n in EFFECTS and EFFECTS[n].of_the_law for n in names)


def _may_join(member: Member, inside: Sequence[Member]) -> bool:
    """Whether a member may be added: one of a name, but several without a name that are of different places."""
    if not one_law([member.name, *(one.name for one in inside)]):
        return False
    if member.named or not member.theta:
        return all(member.name != one.name for one in inside)
    return all(
        (member.name, member.theta) != (one.name, one.theta) and (one.theta or member.name != one.name)
        for one in inside
    )


def columns_of(linear: Linear, explanation: Explanation) -> tuple[IntArray, FloatArray]:
    """Columns (k,) of an explanation's members and the scale of each, (k,) mm."""
    if not explanation.members:
        return np.zeros(0, np.int64), np.zeros(0)
    at = [linear.at[i] for i in explanation.members]
    return np.concatenate(at), np.repeat(explanation.scales_mm, [a.size for a in at])


def _given(
    linear: Linear, one: Normal, explanation: Explanation
) -> tuple[float, tuple[IntArray, FloatArray, FloatArray]]:
    """Log evidence of an explanation at its scales under one set of levels; and its columns, the root of what they
    take off the normal equations, and of the moments."""
    at, scale = columns_of(linear, explanation)
    if not at.size:
        return one.base, (at, np.zeros((0, 0)), np.zeros(0))
    inner = one.gram[np.ix_(at, at)] * np.outer(scale, scale) + np.eye(at.size)
    root = np.linalg.cholesky(inner)
    half = np.linalg.solve(root, scale * one.moment[at])
    value = one.base + 0.5 * float(half @ half) - float(np.log(np.diag(root)).sum())
    return value, (at, np.linalg.solve(root, np.diag(scale)), half)


def _gain(one: Normal, given: tuple[IntArray, FloatArray, FloatArray], at: IntArray) -> FloatArray:
    """Log evidence that members (c,) of columns ``at`` (c, k) add to those in the set, for each scale, (c, scales)."""
    own, root, half = given
    gram = one.gram[at[:, :, None], at[:, None, :]]
    moment = one.moment[at]
    if own.size:
        taken = np.einsum("rj,jck->crk", root, one.gram[own][:, at])
        gram = gram - np.einsum("cri,crj->cij", taken, taken)
        moment = moment - np.einsum("crk,r->ck", taken, half)
    values, axes = np.linalg.eigh(gram)
    along = np.einsum("ckj,ck->cj", axes, moment) ** 2
    values = np.maximum(values, 0.0)[:, None, :] * SCALES_MM[:, None] ** 2
    along = along[:, None, :] * SCALES_MM[:, None] ** 2
    return np.asarray(np.sum(0.5 * along / (1 + values) - 0.5 * np.log1p(values), axis=2))


def log_evidence(search: Search, explanation: Explanation) -> FloatArray:
    """Log evidence of an explanation under each of the levels, (levels,)."""
    return np.array([_given(search.linear, one, explanation)[0] for one in search.normals])


def sizes_mm(search: Search, explanation: Explanation) -> dict[str, float]:
    """Posterior mean size of each member, mm RMS over the edges, under the likeliest levels; of one without a name what
    Eq. 5 and a straight beam would leave of it, for they may be what it is."""
    linear = search.linear
    at, scale = columns_of(linear, explanation)
    if not at.size:
        return {}
    one = search.normals[int(np.argmax(log_evidence(search, explanation)))]
    information = one.gram[np.ix_(at, at)] + np.diag(scale**-2.0)
    mean = np.linalg.solve(information, one.moment[at])
    out, k = {}, 0
    for i in explanation.members:
        own = linear.at[i]
        moved = linear.columns[:, own] @ mean[k : k + own.size]
        if not linear.members[i].named:
            moved = moved - linear.model @ np.linalg.lstsq(linear.model, moved, rcond=None)[0]
        out[linear.members[i].name] = float(np.sqrt(np.mean(moved**2)))
        k += own.size
    return out
