"""Where Eq. 5's rates, and a plateau's speed, would best be sought: over a grid, all else linear.

Gauss–Newton walks along the valley of two exponentials only as far as its start allows. Seen from one placing of the
edges the residual is linear in everything but the rates and the plateau, and every pair of rates shares its columns
with the others: white columns of a dozen rates give all pairs at the price of one step (variable projection, Golub and
Pereyra 1973).
"""

from __future__ import annotations

import numpy as np

from draglag.gap.model import LEAST_AMPLITUDE_S, LawParameters
from draglag.gap.state import State
from draglag.gap.whitening import Whitener
from draglag.recording import FloatArray

RATES_S_MM = np.geomspace(0.001, 0.06, 12)
PLATEAUS = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4)  # of the present one
CALM = 4.0  # standard deviations beyond which an edge's pull does not grow


def best_rates(state: State, white: Whitener, use: np.ndarray) -> tuple[LawParameters, FloatArray] | None:
    """The likeliest law of the grid, and the step of everything else that goes with it ((p,), the law's own part 0).

    None where no pair of rates has two falling exponentials.
    """
    law = state.law
    n_law = 6 if law.plateau_mm_s > 0 else 5
    v_n = state.placed.v_mm_s[use, 1] * state.placed.stretch[use]
    speed = state.placed.speed_mm_s[use]
    rest, prior = state.design[use][:, n_law:], state.prior[n_law:]
    # Without the present law: what a new one has to explain as a whole.
    whole = white.apply(np.column_stack([state.residual[use] - v_n * law(speed), -v_n, rest]))
    calm = 1 / np.sqrt(np.maximum(1.0, np.abs(white.apply(state.residual[use])) / CALM))[:, None]
    target, others = whole[:, 0] * calm[:, 0], whole[:, 1:] * calm
    # What is common to all laws is projected off once.
    ridge = np.concatenate([[1e-9], prior])
    spread = np.linalg.pinv(others.T @ others + np.diag(ridge), hermitian=True)
    best: tuple[float, LawParameters, FloatArray] | None = None
    plateaus = [s * law.plateau_mm_s for s in PLATEAUS] if law.plateau_mm_s > 0 else [0.0]
    for plateau in plateaus:
        held = LawParameters(1.0, 1.0, 0.0, 1.0, 0.0, plateau).counted_mm_s(speed)
        slow = white.apply(-v_n[:, None] * np.exp(-held[:, None] * RATES_S_MM)) * calm
        cross, moment = others.T @ slow, others.T @ target
        gram = slow.T @ slow - cross.T @ spread @ cross
        pull = slow.T @ target - cross.T @ spread @ moment
        for i in range(RATES_S_MM.size):
            for j in range(i + 1, RATES_S_MM.size):
                both = np.array([i, j])
                sizes = np.linalg.solve(gram[np.ix_(both, both)] + 1e-9 * np.eye(2), pull[both])
                if sizes.min() < LEAST_AMPLITUDE_S:
                    continue
                value = float(sizes @ pull[both])
                if best is None or value > best[0]:
                    left = spread @ (moment - cross[:, both] @ sizes)
                    found = LawParameters(sizes[0], RATES_S_MM[i], sizes[1], RATES_S_MM[j], left[0], plateau)
                    best = value, found, np.concatenate([np.zeros(n_law), left[1:]])
    return None if best is None else best[1:]
