"""Setting of a second filter."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import FloatArray


class By(IntEnum):
    """What switches the filter: a theta's second number."""

    SPEED = 0
    ACCELERATION = 1
    TIME = 2
    TIME_SHOWN = 3


@dataclass(frozen=True)
class Setting:
    """above: threshold, mm/s or mm/s²; if ``shown``, the lateness undone in the traces, s.

    times_s: increasing from–to, session time of the stylus, or of the trace if ``shown``.
    """

    above: float
    by: By
    times_s: tuple[float, ...] = ()

    @classmethod
    def of(cls, theta: tuple[float, ...]) -> Setting | None:
        """Setting of a term, if it has one. Raises DataError for an invalid one."""
        if not theta:
            return None
        if len(theta) < 2 or theta[1] not in list(By):
            raise DataError(
                message("a second filter has no setting {setting}", setting=theta[:2]), "Save the model again"
            )
        return cls(theta[0], By(int(theta[1])), tuple(theta[2:]))

    @property
    def theta(self) -> tuple[float, ...]:
        return self.above, float(self.by), *self.times_s

    @property
    def shown(self) -> bool:
        """Whether touch events show its times and it is undone in the traces."""
        return self.by is By.TIME_SHOWN

    @property
    def timed(self) -> bool:
        return self.by in (By.TIME, By.TIME_SHOWN)

    def within(self, own_s: FloatArray, latency_s: FloatArray) -> np.ndarray:
        """Whether the stylus' session times (m,), shown a latency later, lie in the stretches."""
        return within(self.times_s, own_s + (latency_s if self.shown else 0.0))


def within(times_s: tuple[float, ...], at_s: FloatArray) -> np.ndarray:
    """Whether times (m,) lie in stretches from–to."""
    return np.asarray(np.searchsorted(np.array(times_s), at_s) % 2 == 1)
