"""Grid search of Eq. 5's rates and plateau, all else linear (variable projection, Golub and Pereyra 1973)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.gap.constants import LEAST_PRECISION
from draglag.gap.fitting.likelihood import HUBER_K
from draglag.gap.fitting.model import LEAST_AMPLITUDE_S, LawParameters
from draglag.gap.fitting.state import State
from draglag.gap.fitting.whitening import Whitener
from draglag.recording import FloatArray

RATES_S_MM = np.geomspace(0.001, 0.06, 12)  # closer than a valley is wide. Derived
PLATEAUS = (
    0.7,
    0.8,
    0.9,
    1.0,
    1.1,
    1.25,
    1.4,
)  # factors of the present one that are tried. Derived: closer than its prior


@dataclass(frozen=True)
class WithoutLaw:
    """Whitened residuals before any law.

    others (m, q): asymptote and all but the law, with covariance ``spread`` and ``moment``. huber (m, 1): weights.
    """

    target: FloatArray
    others: FloatArray
    spread: FloatArray
    moment: FloatArray
    v_n: FloatArray
    speed_mm_s: FloatArray
    huber: FloatArray
    white: Whitener


@dataclass(frozen=True)
class Pairs:
    """Pairs of rates (k,) at one plateau.

    gain: twice the log-likelihood, −∞ for a vanishing amplitude; alone: of the best single rate. cross: (q, rates).
    """

    first: np.ndarray
    second: np.ndarray
    sizes: FloatArray
    gain: FloatArray
    alone: float
    cross: FloatArray


def without_law(
    law: LawParameters,
    speed_mm_s: FloatArray,
    v_n: FloatArray,
    residual_mm: FloatArray,
    rest: FloatArray,
    prior: FloatArray,
    white: Whitener,
) -> WithoutLaw:
    """System without its law. rest: (m, p) other columns."""
    whole = white.apply(np.column_stack([residual_mm - v_n * law(speed_mm_s), -v_n, rest]))
    huber = 1 / np.sqrt(np.maximum(1.0, np.abs(white.apply(residual_mm)) / HUBER_K))[:, None]
    target, others = whole[:, 0] * huber[:, 0], whole[:, 1:] * huber
    ridge = np.concatenate([[LEAST_PRECISION], prior])
    spread = np.asarray(np.linalg.pinv(others.T @ others + np.diag(ridge), hermitian=True))
    return WithoutLaw(target, others, spread, others.T @ target, v_n, speed_mm_s, huber, white)


def pairs_at(white_system: WithoutLaw, plateau_mm_s: float, rates_s_mm: FloatArray) -> Pairs:
    """Every pair of rates, all else at its best."""
    counted_mm_s = LawParameters(1.0, 1.0, 0.0, 1.0, 0.0, plateau_mm_s).counted_mm_s(white_system.speed_mm_s)
    slow = (
        white_system.white.apply(-white_system.v_n[:, None] * np.exp(-counted_mm_s[:, None] * rates_s_mm))
        * white_system.huber
    )
    cross = white_system.others.T @ slow
    gram = slow.T @ slow - cross.T @ white_system.spread @ cross
    pull = slow.T @ white_system.target - cross.T @ white_system.spread @ white_system.moment
    own = np.diag(gram) + LEAST_PRECISION
    i, j = np.triu_indices(rates_s_mm.size, 1)
    both = own[i] * own[j] - gram[i, j] ** 2
    sizes = np.column_stack([own[j] * pull[i] - gram[i, j] * pull[j], own[i] * pull[j] - gram[i, j] * pull[i]])
    sizes /= both[:, None]
    gain = np.where(sizes.min(axis=1) >= LEAST_AMPLITUDE_S, sizes[:, 0] * pull[i] + sizes[:, 1] * pull[j], -np.inf)
    alone = np.where(pull > 0, pull**2 / own, 0.0)
    return Pairs(i, j, sizes, gain, float(alone.max()), cross)


def best_rates(state: State, white: Whitener, use: np.ndarray) -> tuple[LawParameters, FloatArray] | None:
    """Likeliest law of the grid and step (p,) of all else, if any."""
    law = state.law
    n_law = 6 if law.plateau_mm_s > 0 else 5
    v_n = state.placed.v_mm_s[use, 1] * state.placed.stretch[use]
    rest, prior = state.design[use][:, n_law:], state.prior[n_law:]
    white_system = without_law(law, state.placed.speed_mm_s[use], v_n, state.residual[use], rest, prior, white)
    best: tuple[float, LawParameters, FloatArray] | None = None
    for plateau in [s * law.plateau_mm_s for s in PLATEAUS] if law.plateau_mm_s > 0 else [0.0]:
        found = pairs_at(white_system, plateau, RATES_S_MM)
        k = int(np.argmax(found.gain))
        if not np.isfinite(found.gain[k]) or (best is not None and found.gain[k] <= best[0]):
            continue
        i, j, (slow, fast) = found.first[k], found.second[k], found.sizes[k]
        left = white_system.spread @ (white_system.moment - found.cross[:, [i, j]] @ found.sizes[k])
        rates = float(RATES_S_MM[i]), float(RATES_S_MM[j])
        new = LawParameters(float(slow), rates[0], float(fast), rates[1], float(left[0]), plateau)
        best = float(found.gain[k]), new, np.concatenate([np.zeros(n_law), left[1:]])
    return None if best is None else best[1:]
