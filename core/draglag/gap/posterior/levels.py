"""Parts of the noise: grids and priors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.gap import constants
from draglag.gap.fitting.noise import Components


@dataclass(frozen=True)
class Part:
    """Values tried, standard deviation of the half-normal prior, largest of a sound rig."""

    values: tuple[float, ...]
    prior_sd: float
    sound: float


NOISE = {
    # Positions, mm: noise slower than the windows of the local fits.
    "slow_mm": Part((0.0, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3, 0.45), 0.15, 0.14),
    # Relative error of the law's argument, a speed.
    "speed": Part((0.0, 0.003, 0.006, 0.01, 0.015, 0.022, 0.03, 0.045), 0.02, 0.022),
    # Error of that speed by tremor, mm/s: 0.1 mm at 9 Hz is 5 mm/s.
    "tremor_mm_s": Part((0.0, 1.0, 2.0, 3.0, 4.5, 6.5, 9.0), 4.0, 6.5),
    # Share by which a run follows its own changes of speed more or less than the law.
    "uneven": Part((0.0, 0.1, 0.2, 0.3, 0.5), 0.2, 0.3),
    # A latency, s, and an offset, mm, of each run: panels, and how the stylus is held.
    "run_s": Part((0.0, 0.00015, 0.0003, 0.0005, 0.0008, 0.0012, 0.002), 0.0006, 0.0012),
    "run_mm": Part((0.0, 0.02, 0.05, 0.1), 0.05, 0.1),
    # Lateness of single reports and one that wanders, s: ages of reports.
    "late_s": Part((0.0, 0.0002, 0.0004, 0.0007, 0.0012, 0.002, 0.003), 0.0004, 0.0007),
    "wander_s": Part((0.0, 0.0002, 0.0004, 0.0007, 0.0012, 0.002, 0.003), 0.0004, 0.0007),
}
"""Parts of the noise: values that are tried, standard deviation of the prior, most of a sound rig. Values: steps of a
factor 1.4 or so, finer than a session knows them. Priors and the most of sound rigs: physical
(facts on hands, digitisers and sensors), checked on sound sessions of two generators."""

_MISFIT_MM = tuple(x for x in constants.MISFIT_MM if x >= constants.LEAST_MISFIT_MM)
PARTS = NOISE | {"misfit_mm": Part(_MISFIT_MM, np.inf, _MISFIT_MM[-1])}
"""Parts of the noise, and the scale of every tolerated shape, mm. Derived from NOISE and MISFIT_MM."""

UNSURE_AGE_SD_S = 0.002
"""Prior standard deviation of both latenesses where the stamps are sampled or rounded: a tick is 8 to 16 ms.
Physical."""


def is_sound(levels: Components) -> bool:
    """Whether no part is larger than on sound rigs."""
    return all(getattr(levels, name) <= part.sound * 1.001 for name, part in PARTS.items())


def within_sound(levels: Components) -> Components:
    return replace(levels, **{name: min(getattr(levels, name), part.sound) for name, part in PARTS.items()})


def log_prior(levels: Components, unsure_ages: bool) -> float:
    """Log prior; more scatter than on sound rigs has ``P_UNSOUND``."""
    total = 0.0
    for name, part in PARTS.items():
        sd = UNSURE_AGE_SD_S if unsure_ages and name in ("late_s", "wander_s") else part.prior_sd
        total -= 0.5 * (getattr(levels, name) / sd) ** 2
    return total if unsure_ages or is_sound(levels) else total + float(np.log(constants.P_UNSOUND))
