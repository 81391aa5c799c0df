"""Undoing of a 1 euro filter in traces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.sparse import identity

from draglag.path.events import first_of_contact, sample_interval_s
from draglag.path.local_fit import local_fit
from draglag.simulation.effects.in_fits import UndoneTrace
from draglag.simulation.effects.speed_adaptive_filter.filtering import (
    Setting,
    cut_off_hz,
    unfiltered,
)

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData


@dataclass(frozen=True)
class Unfiltered:
    """Shown position plus time constant times locally fitted velocity; the exact inverse amplifies noise up to 20
    times."""

    setting: Setting

    place: ClassVar[int] = 3
    of_events: ClassVar[bool] = True

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        n, first = trace.t_s.size, first_of_contact(trace.t_s)
        raw_mm = unfiltered(trace.t_s, trace.xy_mm, self.setting, first)
        lag_s = 1 / (2 * np.pi * cut_off_hz(trace.t_s, raw_mm, self.setting, first))
        middle_s = trace.t_s - 0.5 * sample_interval_s(trace.t_s)  # a step between two events is the velocity there
        fit = local_fit(trace.t_s, trace.xy_mm, middle_s, shown.velocity_half_s)
        moved = lag_s[:, None] * fit.by_event.velocity
        spread = (identity(n, format="csr") + fit.rows(moved, n))[fit.ok]
        whole = spread if trace.spread is None else spread @ trace.spread
        return replace(trace, t_s=trace.t_s[fit.ok], xy_mm=spread @ trace.xy_mm, spread=whole)
