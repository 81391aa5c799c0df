"""Device clocks on the host's clock: offset and drift from bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from draglag.errors import DataError
from draglag.messages import Message, message
from draglag.recording import ClockBounds, FloatArray, IntArray, Run, concatenate

# No quartz in an instrument is further off; it bounds the band while the bounds span little time.
LARGEST_DRIFT = 300e-6
# An uncertainty above this matters to a latency and is reported to the operator.
WARN_S = 1e-3
# The paper's hardware comparison: below 1 ms in 60 s.
PAPER_DRIFT = 1e-3 / 60.0
# Rounding of double seconds since boot; bounds are never sharper.
_ROUNDING_S = 1e-9


@dataclass(frozen=True)
class EpochClock:
    """One epoch of a device clock: ``host = device + offset_s + drift · (device − reference_s)``.

    Lines within all bounds form a convex polygon in offset and drift; the estimate is its centre.

    Attributes:
        corners: (k, 2) of the polygon: offset relative to ``offset_s``, drift.
        slack_s: least widening of the bounds for a line to fit, usually 0.
        uneven_s: what that adds to every half width.
    """

    epoch: int
    reference_s: float
    offset_s: float
    drift: float
    drift_interval: tuple[float, float]
    corners: FloatArray
    first_s: float
    last_s: float
    n_bounds: int
    slack_s: float = 0.0
    uneven_s: float = 0.0

    @property
    def fast_ppm(self) -> float:
        """Rate against the host's clock; negative where slow."""
        return -1e6 * self.drift

    @property
    def fast_interval_ppm(self) -> tuple[float, float]:
        return -1e6 * self.drift_interval[1], -1e6 * self.drift_interval[0]

    def to_host(self, device_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Host times and half widths of device times (n,)."""
        span = np.asarray(device_s, np.float64) - self.reference_s
        host = self.reference_s + self.offset_s + span * (1.0 + self.drift)
        spread = self.corners[:, :1] + (self.corners[:, 1:] - self.drift) * span.reshape(1, -1)
        return host, np.abs(spread).max(axis=0) + self.uneven_s + _ROUNDING_S


@dataclass(frozen=True)
class ClockFit:
    """A device clock over its epochs."""

    stream: str
    epochs: Mapping[int, EpochClock] = field(default_factory=dict)

    def map_to_host(self, device_s: FloatArray, epoch: IntArray | int = 0) -> tuple[FloatArray, FloatArray]:
        """Host times of device stamps and their half widths, (n,). Raises DataError for an epoch without bounds."""
        device_s = np.atleast_1d(np.asarray(device_s, np.float64))
        epochs = np.broadcast_to(np.asarray(epoch, np.int64), device_s.shape)
        host, width = np.empty(len(device_s)), np.empty(len(device_s))
        for number in np.unique(epochs).tolist():
            if number not in self.epochs:
                raise DataError(
                    message(
                        "the {stream} clock was never compared with the host's in its epoch {epoch}",
                        stream=self.stream,
                        epoch=number,
                    ),
                    "compare the clocks before or after each run",
                )
            here = epochs == number
            host[here], width[here] = self.epochs[number].to_host(device_s[here])
        return host, width


def fit_clock(bounds: ClockBounds | Sequence[ClockBounds]) -> ClockFit:
    """The clock of one stream; a one-sided bound has an infinite other side.

    Epochs not bounded from both sides are left out. Raises DataError on several streams, no rows, or invalid stamps.
    """
    parts = [bounds] if isinstance(bounds, ClockBounds) else list(bounds)
    if not parts:
        raise DataError("there are no clock comparisons to fit")
    if len({part.stream for part in parts}) > 1:
        raise DataError(
            message(
                "clock comparisons of several devices: {streams}", streams=", ".join(sorted({p.stream for p in parts}))
            )
        )
    whole = concatenate([_with_epochs(part) for part in parts])
    if not np.isfinite(whole.device_s).all() or np.isnan(whole.host_min_s).any() or np.isnan(whole.host_max_s).any():
        raise DataError(
            message("the clock comparisons of the {stream} hold stamps that are not numbers", stream=whole.stream)
        )
    fitted: dict[int, EpochClock] = {}
    for epoch in np.unique(whole.epoch).tolist():
        here = whole.epoch == epoch
        device, low, high = whole.device_s[here], whole.host_min_s[here], whole.host_max_s[here]
        if np.isfinite(low).any() and np.isfinite(high).any():
            fitted[epoch] = _fit_epoch(epoch, device, low, high)
    return ClockFit(whole.stream, fitted)


def fit_clocks(bounds: Iterable[ClockBounds]) -> dict[str, ClockFit]:
    """Stream → its clock."""
    streams: dict[str, list[ClockBounds]] = {}
    for part in bounds:
        if len(part.device_s):
            streams.setdefault(part.stream, []).append(part)
    return {stream: fit_clock(parts) for stream, parts in streams.items()}


def rate_words(fast_ppm: float, digits: int = 1) -> Message:
    """A clock's rate in words: "24.4 ppm fast"."""
    ppm = f"{abs(fast_ppm):.{digits}f}"
    return message("{ppm} ppm fast", ppm=ppm) if fast_ppm >= 0 else message("{ppm} ppm slow", ppm=ppm)


def clock_warnings(fit: ClockFit, of_width: bool = True) -> list[str]:
    """Warnings about a clock; ``of_width``: also that its time is too uncertain."""
    said: list[str] = []
    for clock in fit.epochs.values():
        which = message("The {stream} clock", stream=fit.stream)
        if len(fit.epochs) > 1:
            which = message("The {stream} clock (epoch {epoch})", stream=fit.stream, epoch=clock.epoch)
        _, width = clock.to_host(np.linspace(clock.first_s, clock.last_s, 33))
        worst = float(width.max())
        if of_width and worst > WARN_S:
            said.append(
                message(
                    "{clock} is known to ±{worst:.2f} ms only; above {limit:.0f} ms it matters.",
                    clock=which,
                    worst=1e3 * worst,
                    limit=1e3 * WARN_S,
                )
            )
        if clock.slack_s > 1e-4:
            said.append(
                message(
                    "{clock} does not run evenly: its comparisons contradict each other by {slack:.2f} ms.",
                    clock=which,
                    slack=1e3 * clock.slack_s,
                )
            )
        low, high = clock.drift_interval
        if low > PAPER_DRIFT or high < -PAPER_DRIFT:
            said.append(
                message(
                    "{clock} runs {rate} ({ms:.2f} ms in 60 s); it is corrected, but more than the paper's 1 ms in "
                    "60 s.",
                    clock=which,
                    rate=rate_words(clock.fast_ppm),
                    ms=0.06 * abs(clock.fast_ppm),
                )
            )
    return said


def laser_clock(run: Run, also: Sequence[ClockBounds] = ()) -> ClockFit | None:
    """The laser's clock from comparisons of run and session."""
    parts = [part for part in (*run.sync, *also) if part.stream == "laser" and len(part.device_s)]
    return fit_clock(parts) if parts else None


def remapped_within(run: Run, also: Sequence[ClockBounds] = ()) -> tuple[Run, float | None]:
    """``remapped`` and ``latency_uncertainty_s`` at once."""
    device_s = run.laser.device_t_s
    if not len(device_s):
        return run, 0.0
    fit = laser_clock(run, also)
    if fit is None:
        return run, None
    try:
        host_s, width = fit.map_to_host(device_s, run.laser.epoch if len(run.laser.epoch) else 0)
    except DataError:
        return run, None
    return replace(run, laser=replace(run.laser, t_s=host_s)), float(width.max())


def latency_uncertainty_s(run: Run, also: Sequence[ClockBounds] = ()) -> float | None:
    """Half width of the shift of a run's latencies by clocks, common to all edges.

    0.0 for edges stamped on the host's clock; None for device stamps without comparisons.
    """
    return remapped_within(run, also)[1]


def remapped(run: Run, also: Sequence[ClockBounds] = ()) -> Run:
    """The run with edges mapped by all comparisons, if any."""
    return remapped_within(run, also)[0]


def _with_epochs(part: ClockBounds) -> ClockBounds:
    n = len(part.device_s)
    if len(part.host_min_s) != n or len(part.host_max_s) != n or len(part.epoch) not in (0, n):
        raise DataError(
            message("the clock comparisons of the {stream} have columns of different lengths", stream=part.stream)
        )
    return part if len(part.epoch) == n else replace(part, epoch=np.zeros(n, np.int64))


def _fit_epoch(epoch: int, device: FloatArray, low: FloatArray, high: FloatArray) -> EpochClock:
    reference = float((device.min() + device.max()) / 2)
    span = device - reference
    base = float(np.median((low - device)[np.isfinite(low)]))
    # Lines must pass above the floor and below the ceiling; only the hulls of both can touch them.
    floor = _hull(span, low - device - base, upper=True)
    ceiling = _hull(span, high - device - base, upper=False)
    slack, uneven = 0.0, 0.0
    polygon = _feasible(floor, ceiling, slack)
    if not len(polygon):
        slack = 1.01 * _least_slack(floor, ceiling) + _ROUNDING_S
        trips = (high - low)[np.isfinite(high - low)]
        uneven = slack + (float(np.median(trips)) if trips.size else 0.0)
        polygon = _feasible(floor, ceiling, slack)
    if not len(polygon):
        raise DataError("the clock comparisons cannot be fitted", "compare the clocks again")
    offset, drift = _centre(polygon)
    corners = polygon - np.array([offset, 0.0])
    return EpochClock(
        epoch=epoch,
        reference_s=reference,
        offset_s=base + offset,
        drift=drift,
        drift_interval=(float(polygon[:, 1].min()), float(polygon[:, 1].max())),
        corners=corners,
        first_s=float(device.min()),
        last_s=float(device.max()),
        n_bounds=len(device),
        slack_s=slack,
        uneven_s=uneven,
    )


def _hull(x: FloatArray, y: FloatArray, upper: bool) -> FloatArray:
    """Convex hull (k, 2), upper or lower (Andrew's monotone chain)."""
    sign = -1.0 if upper else 1.0
    good = np.isfinite(y)
    x, y = x[good], sign * y[good]
    order = np.lexsort((y, x))
    order = order[np.append(True, np.diff(x[order]) > 0)]  # of points above each other only the outermost counts
    x, y = x[order], y[order]
    # A point above the line through its neighbours is no corner; most go at once.
    for _ in range(8 if x.size > 20 else 0):
        rise = np.diff(y) / np.diff(x)
        keep = np.concatenate([[True], rise[:-1] < rise[1:], [True]])
        if keep.all():
            break
        x, y = x[keep], y[keep]
    chain: list[tuple[float, float]] = []
    for px, py in zip(x.tolist(), y.tolist(), strict=True):
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2], chain[-1]
            if (by - ay) * (px - ax) < (py - ay) * (bx - ax):
                break
            chain.pop()
        chain.append((px, py))
    hull = np.array(chain)
    hull[:, 1] *= sign
    return hull


def _least_slack(floor: FloatArray, ceiling: FloatArray) -> float:
    from scipy.optimize import linprog

    scale = 1e6  # microseconds and ppm keep the solver's tolerances meaningful
    rows = [[-1.0, -x, -1.0] for x, _ in floor] + [[1.0, x, -1.0] for x, _ in ceiling]
    sides = [-scale * y for _, y in floor] + [scale * y for _, y in ceiling]
    limit = scale * LARGEST_DRIFT
    found = linprog([0.0, 0.0, 1.0], A_ub=rows, b_ub=sides, bounds=[(None, None), (-limit, limit), (0.0, None)])
    if not found.success:
        raise DataError("the clock comparisons cannot be fitted", "compare the clocks again")
    return float(found.x[2]) / scale


def _feasible(floor: FloatArray, ceiling: FloatArray, slack: float) -> FloatArray:
    """Corners (offset, drift) of the lines between floor and ceiling."""
    reach = 1.0 + float(np.abs(np.concatenate([floor[:, 1], ceiling[:, 1]])).max())
    reach += LARGEST_DRIFT * float(np.abs(np.concatenate([floor[:, 0], ceiling[:, 0]])).max())
    b = LARGEST_DRIFT
    polygon = [(-reach, -b), (reach, -b), (reach, b), (-reach, b)]
    widen = slack + _ROUNDING_S
    for x, y in floor.tolist():
        polygon = _cut(polygon, -1.0, -x, -(y - widen))
    for x, y in ceiling.tolist():
        polygon = _cut(polygon, 1.0, x, y + widen)
    return np.array(polygon).reshape(-1, 2)


# Polygons have some ten corners: plain floats are several times faster than arrays.
Corner = tuple[float, float]


def _cut(polygon: list[Corner], across: float, along: float, limit: float) -> list[Corner]:
    """The part of a convex polygon where across · offset + along · drift ≤ limit."""
    excess = [across * offset + along * drift - limit for offset, drift in polygon]
    if not excess or max(excess) <= 0:
        return polygon
    kept: list[Corner] = []
    for k, there in enumerate(excess):
        here = excess[k - 1]
        if (here > 0) != (there > 0):
            share = here / (here - there)
            (a, b), (c, d) = polygon[k - 1], polygon[k]
            kept.append((a + share * (c - a), b + share * (d - b)))
        if there <= 0:
            kept.append(polygon[k])
    return kept


def _centre(polygon: FloatArray) -> tuple[float, float]:
    middle = polygon.mean(axis=0)
    scale = np.ptp(polygon, axis=0)
    if (scale <= 0).any():
        return float(middle[0]), float(middle[1])
    p = (polygon - middle) / scale
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]
    area = cross.sum()
    if abs(area) < 1e-9:
        return float(middle[0]), float(middle[1])
    centre = ((p + q) * cross[:, None]).sum(axis=0) / (3.0 * area) * scale + middle
    return float(centre[0]), float(centre[1])
