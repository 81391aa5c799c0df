"""Which filters a panel has, what their one size leaves open, and the way of the scans through them."""

from typing import Any

import numpy as np

from .deadband import KINDS, deadband
from .euro import euro
from .low_pass import first_order, moving_average
from .prediction import predict
from .tracker import alpha_beta

# In the order in which a controller runs them. The first four are its smoothing, which it has one of.
SMOOTHING = ("speed_adaptive_filter", "first_order_iir", "moving_average_by_speed", "alpha_beta_tracker")
FILTERS = (*SMOOTHING, "prediction", "deadband")

XY = tuple[np.ndarray, np.ndarray]


def draw_filter(name: str, rng: np.random.Generator) -> dict[str, Any]:
    """What the size of the filter leaves open."""
    if name == "speed_adaptive_filter":
        return {"beta": rng.uniform(0.01, 0.05), "per_axis": bool(rng.random() < 0.3)}
    if name == "alpha_beta_tracker":
        return {"ahead_s": float(rng.choice([0.0, 0.01]))}
    if name == "deadband":
        return {"kind": str(rng.choice(KINDS))}
    return {}


def run_filters(effects: dict[str, float], variants: dict[str, Any], t_s: np.ndarray, xy: XY) -> XY:
    """The scans (n,) behind every filter among `effects`."""
    for name in FILTERS:
        if name not in effects:
            continue
        size, more = effects[name], variants.get(name, {})
        if name == "speed_adaptive_filter":
            xy = euro(t_s, xy, size, more["beta"], more["per_axis"])
        elif name == "first_order_iir":
            xy = first_order(t_s, xy, size)
        elif name == "moving_average_by_speed":
            xy = moving_average(t_s, xy, size)
        elif name == "alpha_beta_tracker":
            xy = alpha_beta(t_s, xy, size, more["ahead_s"])
        elif name == "prediction":
            xy = predict(t_s, xy, size)
        else:
            xy = deadband(xy, size, more["kind"])
    return xy
