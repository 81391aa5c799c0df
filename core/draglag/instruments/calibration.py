"""From a touchscreen's units to mm: an affine fit to touched targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.errors import DataError, EstimateError
from draglag.messages import message
from draglag.recording import FloatArray, Screen

FEWEST_TARGETS = 5
# Share by which a panel's stated size and the touchscreen's resolution may differ: a ruler does better than 1 %.
SIZE_TOLERANCE = 0.02
# A stylus put down with care lands well within this of a cross.
LARGEST_RESIDUAL_MM = 1.5


@dataclass(frozen=True)
class AffineFit:
    """``x_mm = xx·x + xy·y + x0_mm``, ``y_mm = yx·x + yy·y + y0_mm``.

    ``matrix``: (2, 3); ``residual_mm``: (n, 2) touched minus target; ``rms_mm``: by the degrees of freedom left;
    ``scale_mm``: (x, y) mm per device unit.
    """

    matrix: FloatArray
    residual_mm: FloatArray
    rms_mm: float

    @property
    def worst_mm(self) -> float:
        return float(np.hypot(*self.residual_mm.T).max())

    @property
    def scale_mm(self) -> tuple[float, float]:
        x, y = np.linalg.norm(self.matrix[:, :2], axis=1)
        return float(x), float(y)

    def __call__(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Device units, both (n,), to mm."""
        (xx, xy, x0), (yx, yy, y0) = self.matrix
        return xx * x + xy * y + x0, yx * x + yy * y + y0


def fit_affine(
    x: FloatArray,
    y: FloatArray,
    x_mm: FloatArray,
    y_mm: FloatArray,
    largest_residual_mm: float = LARGEST_RESIDUAL_MM,
) -> AffineFit:
    """Least-squares map from touches (device units) at targets, (n,) each.

    Raises:
        DataError: columns of different lengths or not numbers.
        EstimateError: fewer than 5 targets, all along one line, or one too far off.
    """
    raw, places = np.column_stack([x, y]).astype(np.float64), np.column_stack([x_mm, y_mm]).astype(np.float64)
    if raw.shape != places.shape or not np.isfinite(raw).all() or not np.isfinite(places).all():
        raise DataError("touches and targets do not match one to one", "touch every target once")
    n = len(raw)
    if n < FEWEST_TARGETS:
        raise EstimateError(
            message("{n} targets do not determine a calibration", n=n),
            message("touch {k} or better 9", k=FEWEST_TARGETS),
        )
    along = message("the targets lie nearly along one line"), message("the touches lie nearly along one line")
    for points, problem in zip((places, raw), along, strict=True):
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if spread[1] < 0.1 * spread[0]:
            raise EstimateError(problem, "use targets spread over the whole screen")
    # Centred and scaled, so that 32-bit units condition as well as pixels.
    middle, scale = raw.mean(axis=0), raw.std(axis=0).max()
    design = np.column_stack([(raw - middle) / scale, np.ones(n)])
    solution, *_ = np.linalg.lstsq(design, places, rcond=None)
    linear = solution[:2].T / scale
    matrix = np.column_stack([linear, solution[2] - linear @ middle])
    residual = design @ solution - places
    fit = AffineFit(matrix, residual, float(np.sqrt((residual**2).sum() / (n - 3))))
    if fit.worst_mm > largest_residual_mm:
        worst = int(np.argmax(np.hypot(*residual.T)))
        raise EstimateError(
            message(
                "target {target} is off by {off_mm:.1f} mm after the fit (limit {limit_mm:.1f} mm)",
                target=worst + 1,
                off_mm=fit.worst_mm,
                limit_mm=largest_residual_mm,
            ),
            "touch the targets again, in the order shown",
        )
    return fit


def px_to_mm(screen: Screen, x_px: FloatArray, y_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels to mm, from the upper left corner."""
    x_scale, y_scale = screen.mm_per_px
    return np.asarray(x_px) * x_scale, np.asarray(y_px) * y_scale


def target_places(width_mm: float, height_mm: float, count: int = 9) -> tuple[FloatArray, FloatArray]:
    """Places of 5 or 9 targets, a tenth of the screen from its border. Raises DataError."""
    if count not in (5, 9):
        raise DataError(message("{n} targets: only 5 or 9 can be shown", n=count))
    across, down = np.meshgrid([0.1, 0.5, 0.9], [0.1, 0.5, 0.9])
    places = np.column_stack([across.ravel() * width_mm, down.ravel() * height_mm])
    if count == 5:
        places = places[::2]
    return places[:, 0], places[:, 1]
