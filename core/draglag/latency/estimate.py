"""The estimate of one run, and an estimator's input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.errors import EstimateError
from draglag.instruments.beam import Lines
from draglag.latency.edges import Edges, clean_edges
from draglag.messages import message
from draglag.path.events import hold_at_rate, last_of_batches, sample_interval_s, without_strays
from draglag.reading.limits import EVENT_S
from draglag.recording import FloatArray, Run, TouchTrace
from draglag.shown import brief, table_html

WINDOW_S = (0.0, 0.4)  # latencies searched
FEW_EDGES = 8  # below this an interval means little
FEWEST_EDGES = 6  # below this nothing is estimated: four parameters are
GUESS_S = 0.06  # of a latency where none is known. Physical: a usual touchscreen


@dataclass(frozen=True)
class Alignment:
    """Edges on the screen before and after the shift (the paper's Fig. 4).

    Attributes (m edges): x_raw_mm, y_raw_mm: at the edge; x_mm, y_mm, speed_mm_s, v_mm_s (m, 2): at t + L; side: −1
    top, +1 bottom; falling: light→dark; residual_mm: along y.
    """

    edge_t_s: FloatArray
    x_raw_mm: FloatArray
    y_raw_mm: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    side: FloatArray
    falling: np.ndarray
    residual_mm: FloatArray
    latency_s: FloatArray
    speed_mm_s: FloatArray
    v_mm_s: FloatArray
    lines: Lines

    @property
    def slope(self) -> float:
        return self.lines.slope_top

    @property
    def intercept_top_mm(self) -> float:
        return self.lines.intercept_top_mm

    @property
    def intercept_bottom_mm(self) -> float:
        return self.lines.intercept_bottom_mm

    __repr__ = brief


@dataclass(frozen=True)
class RunEstimate:
    """Latency of one run with its 95 % interval.

    ``latency_s``, ``latency_se_s``: mean over the edges. ``se_at_speed_s``: without tremor's scatter, at ``speed_mm_s``
    (None: the same). ``speed_sd_mm_s``: over edges. ``flags``: ``draglag.latency.flags.MEANING``.
    ``clock_uncertainty_s``: largest shift by the laser's clock; None if unknown. ``correction_s``: already in the
    latency; ``systematic_s``: half width (95 %), clock included.
    """

    id: str
    protocol: str
    nominal_speed_mm_s: float | None
    stamps: str
    n_edges: int = 0
    n_rejected: int = 0
    speed_mm_s: float | None = None
    speed_filtered_mm_s: float | None = None
    speed_se_mm_s: float | None = None
    speed_sd_mm_s: float | None = None
    latency_s: float | None = None
    latency_se_s: float | None = None
    se_at_speed_s: float | None = None
    latency_ci95_s: tuple[float, float] | None = None
    j0_per_edge_mm2: float | None = None
    j_per_edge_mm2: float | None = None
    stylus_diameter_mm: float | None = None
    stylus_diameter_se_mm: float | None = None
    travel_per_diameter: float | None = None
    flags: tuple[str, ...] = ()
    alignment: Alignment | None = None
    clock_uncertainty_s: float | None = 0.0
    correction_s: float = 0.0
    systematic_s: float = 0.0

    @property
    def curve_se_s(self) -> float | None:
        """Standard error for the fit of a curve."""
        return self.latency_se_s if self.se_at_speed_s is None else self.se_at_speed_s

    @property
    def random_s(self) -> float | None:
        """Random half width (95 %)."""
        if self.latency_ci95_s is None:
            return None
        half_s = 0.5 * (self.latency_ci95_s[1] - self.latency_ci95_s[0])
        return float(np.sqrt(max(half_s**2 - self.systematic_s**2, 0.0)))

    @property
    def latency_ms(self) -> float | None:
        return None if self.latency_s is None else 1e3 * self.latency_s

    @property
    def latency_ci95_ms(self) -> tuple[float, float] | None:
        return None if self.latency_ci95_s is None else (1e3 * self.latency_ci95_s[0], 1e3 * self.latency_ci95_s[1])

    def to_dict(self) -> dict[str, object]:
        """JSON of one run."""
        return {
            "id": self.id,
            "protocol": self.protocol,
            "nominal_speed_mm_s": self.nominal_speed_mm_s,
            "speed_mm_s": self.speed_mm_s,
            "speed_filtered_mm_s": self.speed_filtered_mm_s,
            "latency_ms": self.latency_ms,
            "latency_ci95_ms": None if self.latency_ci95_ms is None else list(self.latency_ci95_ms),
            "latency_random_ms": None if self.random_s is None else 1e3 * self.random_s,
            "latency_systematic_ms": 1e3 * self.systematic_s,
            "correction_ms": 1e3 * self.correction_s,
            "clock_uncertainty_ms": None if self.clock_uncertainty_s is None else 1e3 * self.clock_uncertainty_s,
            "stamps": self.stamps,
            "n_edges": self.n_edges,
            "n_rejected": self.n_rejected,
            "J0_per_edge_mm2": self.j0_per_edge_mm2,
            "J_per_edge_mm2": self.j_per_edge_mm2,
            "stylus_diameter_mm": self.stylus_diameter_mm,
            "travel_per_diameter": self.travel_per_diameter,
            "flags": list(self.flags),
        }

    __repr__ = brief

    def _repr_html_(self) -> str:
        low_ms, high_ms = self.latency_ci95_ms or (None, None)
        head = ["speed_mm_s", "latency_ms", "low", "high", "n_edges", "stylus_diameter_mm", "flags"]
        row = [self.speed_mm_s, self.latency_ms, low_ms, high_ms, self.n_edges, self.stylus_diameter_mm]
        return table_html(f"{self.id} ({self.protocol})", head, [[*row, ", ".join(self.flags)]])


@dataclass(frozen=True)
class Prepared:
    run: Run
    touch: TouchTrace
    edges: Edges
    stamps: str
    dt_s: float
    stylus_diameter_mm: float
    n_strays: int = 0

    @property
    def xy_mm(self) -> FloatArray:
        return np.column_stack([self.touch.x_mm, self.touch.y_mm])


def prepare(run: Run, stylus_diameter_mm: float, update_rate_hz: float | None = None) -> Prepared:
    """Usable events and clean edges of a run. Raises EstimateError with fewer than 20, or fewer than a panel sends."""
    touch, n_strays = without_strays(run.touch)
    touch, stamps = last_of_batches(touch), "kernel"
    if touch.t_s.size < 20:
        raise EstimateError(
            message("{run}: {n} touch events", run=run.id, n=touch.t_s.size),
            "Record the run again with the stylus on the screen",
        )
    if update_rate_hz is not None:
        touch, stamps = hold_at_rate(touch, update_rate_hz), f"last event held at {update_rate_hz:g} Hz"
    dt_s = sample_interval_s(touch.t_s)
    if dt_s > EVENT_S:
        raise EstimateError(
            message("{run}: one touch event every {dt_s:.3g} s", run=run.id, dt_s=dt_s), "Give all times in seconds"
        )
    edges = clean_edges(run.laser, stylus_diameter_mm, fastest_mm_s(touch))
    return Prepared(run, touch, edges, stamps, dt_s, stylus_diameter_mm, n_strays)


def fastest_mm_s(touch: TouchTrace) -> float:
    """A trace's fastest speed over about 20 ms: coarse, only for telling bounces from edges."""
    step = max(1, round(0.02 / sample_interval_s(touch.t_s)))
    if touch.t_s.size <= step:
        return 1000.0
    moved = np.hypot(touch.x_mm[step:] - touch.x_mm[:-step], touch.y_mm[step:] - touch.y_mm[:-step])
    coarse = moved / (touch.t_s[step:] - touch.t_s[:-step])
    high = int(0.95 * (coarse.size - 1))
    return float(np.partition(coarse, high)[high])
