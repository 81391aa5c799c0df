"""The setting of a second filter: what switches it, and when."""

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
    """by: what switches it. above: a speed, mm/s, or an acceleration, mm/s²; for times shown, the lateness undone in
    the traces, s. times_s: one increasing row from–to, session time of the stylus, or of the trace if shown."""

    above: float
    by: By
    times_s: tuple[float, ...] = ()

    @classmethod
    def of(cls, theta: tuple[float, ...]) -> Setting | None:
        """The setting of a term; None if it has none yet. Raises DataError for an invalid one."""
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
        """Whether its times are the touch events', and it is undone in the traces."""
        return self.by is By.TIME_SHOWN

    @property
    def timed(self) -> bool:
        return self.by in (By.TIME, By.TIME_SHOWN)

    def within(self, own_s: FloatArray, latency_s: FloatArray) -> np.ndarray:
        """Whether the stylus' session times (m,), shown a latency later, lie in the stretches."""
        return within(self.times_s, own_s + (latency_s if self.shown else 0.0))


def within(times_s: tuple[float, ...], at_s: FloatArray) -> np.ndarray:
    """Whether times (m,) lie in a stretch from–to of an increasing row, s."""
    return np.asarray(np.searchsorted(np.array(times_s), at_s) % 2 == 1)
