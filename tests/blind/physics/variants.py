"""What an effect's one size leaves open: where it sits, how often it comes, of what kind it is."""

from collections.abc import Callable

import numpy as np

from .digitiser import LEAST_DELAY_S
from .filters import FILTERS, draw_filter
from .rig import Rig, stream


def draw_variants(seed: int, effects: dict[str, float], rig: Rig) -> dict[str, object]:
    """Effect → its open parts, of those that have any; each drawn from a stream of its own."""
    out: dict[str, object] = {}
    for name, size in effects.items():
        rng = stream(seed, f"variant {name}")
        if name in FILTERS:
            out[name] = draw_filter(name, rng)
        elif name in DRAWN:
            out[name] = DRAWN[name](rng, size, rig)
    return out


def _warp(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    return {
        "cycles": rng.uniform(0.7, 1.6),
        "phase": rng.uniform(0, 2 * np.pi),
        "y_cycles": rng.uniform(0.3, 0.8),
        "y_phase": rng.uniform(0, 2 * np.pi),
    }


def _ripple(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    return {
        "pitch_mm": rng.uniform(4, 7),
        "phases": rng.uniform(0, 2 * np.pi, 4).tolist(),
        "row_share": rng.uniform(0, 1),
    }


def _mode(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    return {
        "kind": str(rng.choice(["speed", "acceleration", "time"], p=[0.6, 0.2, 0.2])),
        "above_mm_s": float(np.exp(rng.uniform(np.log(120), np.log(450)))),
        "above_mm_s2": rng.uniform(80, 250),
        "dwell_s": rng.uniform(4, 15),
    }


def _low_pass(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    # A panel that is quicker than its low-pass does not smooth with it: the delay comes on top.
    fits = size < rig.law.asymptote_s - LEAST_DELAY_S
    return {"delay_in_law": bool(rng.random() < 0.5) and fits}


def _split(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    return {"at_x_mm": rig.screen[1] * rng.uniform(0.3, 0.7)}


def _resonance(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    centre = float(np.exp(rng.uniform(np.log(110), np.log(450))))
    return {"speed_mm_s": centre, "width_mm_s": centre * rng.uniform(0.12, 0.22)}


def _sway(rng: np.random.Generator, size: float, rig: Rig) -> dict[str, object]:
    return {"period_s": rng.uniform(25, 120), "phase": rng.uniform(0, 2 * np.pi)}


DRAWN: dict[str, Callable[[np.random.Generator, float, Rig], dict[str, object]]] = {
    "warm_up": lambda rng, size, rig: {"time_constant_s": rng.uniform(400, 600)},
    "poll_grid": lambda rng, size, rig: {"phase": rng.uniform(0, 1)},
    "spatial_warp": _warp,
    "pitch_ripple": _ripple,
    "second_filter_mode": _mode,
    "smoothing_shrink": _low_pass,
    "lagging_law": lambda rng, size, rig: {"present": bool(rng.random() < 0.25)},
    "split_panel": _split,
    "split_offset": _split,
    "settling": lambda rng, size, rig: {"decay_s": rng.uniform(1.5, 5.0)},
    "speed_resonance": _resonance,
    "stalls": lambda rng, size, rig: {"every_s": rng.uniform(1.5, 4.0)},
    "beam_sway": _sway,
    "loss_of_contact": lambda rng, size, rig: {"shortest_s": 0.05, "longest_s": rng.uniform(0.12, 0.25)},
    "frame_batching": lambda rng, size, rig: {"spacing_s": float(rng.choice([0.0, 2e-5, 1e-4]))},
    "laser_bounce": lambda rng, size, rig: {"share": rng.uniform(0.4, 1.0)},
    "frame_drop": lambda rng, size, rig: {"mean_burst": rng.uniform(1.0, 2.0)},
}
