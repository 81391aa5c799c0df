"""The beam, y = slope · x + intercept, y downwards: the top line has the smaller intercept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray


def sides(falling: np.ndarray, v_across: FloatArray) -> FloatArray:
    """Side of the beam at each edge: −1 top, +1 bottom.

    Args:
        falling: (m,) True for light→dark. v_across: (m,) velocity across the beam, positive downwards.
    """
    down = np.where(v_across >= 0, 1.0, -1.0)
    return np.where(falling, -down, down)


@dataclass(frozen=True)
class Lines:
    """Two lines through the edges."""

    slope_top: float
    slope_bottom: float
    intercept_top_mm: float
    intercept_bottom_mm: float


def fit_lines(x_mm: FloatArray, y_mm: FloatArray, side: FloatArray, shared_slope: bool) -> tuple[Lines, FloatArray]:
    """Least-squares lines through top and bottom edges, and residuals along y.

    ``shared_slope=False`` is the paper's Eq. 2. Raises ValueError if a side has no edge.
    """
    top = side < 0
    if not top.any() or top.all():
        raise ValueError("edges on one side of the beam only")
    if shared_slope:
        xc, yc = x_mm.copy(), y_mm.copy()
        for part in (top, ~top):
            xc[part] -= x_mm[part].mean()
            yc[part] -= y_mm[part].mean()
        denominator = float(xc @ xc)
        slope = float(xc @ yc) / denominator if denominator > 0 else 0.0
        slopes = (slope, slope)
    else:
        slopes = (_slope(x_mm[top], y_mm[top]), _slope(x_mm[~top], y_mm[~top]))
    b_top = float(np.mean(y_mm[top] - slopes[0] * x_mm[top]))
    b_bottom = float(np.mean(y_mm[~top] - slopes[1] * x_mm[~top]))
    lines = Lines(*slopes, b_top, b_bottom)
    residual = np.where(top, y_mm - slopes[0] * x_mm - b_top, y_mm - slopes[1] * x_mm - b_bottom)
    return lines, residual


def _slope(x_mm: FloatArray, y_mm: FloatArray) -> float:
    xc = x_mm - x_mm.mean()
    denominator = float(xc @ xc)
    return float(xc @ y_mm) / denominator if denominator > 0 else 0.0


def stylus_diameter_mm(lines: Lines, x_from_mm: float, x_to_mm: float) -> float:
    """Eq. 3: mean distance of five points of the top line from the bottom line."""
    x_mm = np.linspace(x_from_mm, x_to_mm, 5)
    y_mm = lines.slope_top * x_mm + lines.intercept_top_mm
    distance = np.abs(lines.intercept_bottom_mm + lines.slope_bottom * x_mm - y_mm)
    return float(np.mean(distance) / np.hypot(1.0, lines.slope_bottom))
