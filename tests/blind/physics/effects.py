"""Effects that can be hidden in a session: sizes, units and signs; their action is in the module of each device."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Hidden:
    """One hidden effect.

    `nominal`: a size clearly visible in the residuals of an ordinary session of 12 or more speeds (several standard
    errors; `detectable.py` computes how many). `signed`: occurs with both signs. `inverse`: grows as its number falls
    (a slower host loop holds samples longer). `whole`: numbers for counts.
    """

    nominal: float
    unit: str
    meaning: str
    signed: bool = False
    inverse: bool = False
    whole: bool = False
    in_library: bool = True
    realistic_only: bool = False


EFFECTS: dict[str, Hidden] = {
    "clock_drift": Hidden(30.0, "ppm", "the laser's clock gains on the host's", signed=True),
    "clock_offset": Hidden(0.010, "s", "the laser's clock is ahead of the host's by a constant", signed=True),
    "low_speed_plateau": Hidden(125.0, "mm/s", "below this speed the latency stays what it is at this speed"),
    "sample_hold": Hidden(80.0, "Hz", "a host loop writes the last report, stamped with its tick", inverse=True),
    "laser_hysteresis": Hidden(0.0018, "s", "light returns later than it went"),
    "beam_width": Hidden(0.8, "mm", "the stylus shades the beam as if its diameter were larger", signed=True),
    "laser_bounce": Hidden(0.0008, "s", "edges chatter for this long"),
    "spatial_warp": Hidden(0.8, "mm", "the digitiser's map is bent smoothly"),
    "scale_error": Hidden(0.04, "1", "the digitiser's map is too large, about the middle of the screen", signed=True),
    "direction_asymmetry": Hidden(0.006, "s", "latency moving down exceeds latency moving up", signed=True),
    "acceleration_lag": Hidden(1.0e-5, "s/(mm/s^2)", "latency grows with acceleration along the motion"),
    "contact_trail": Hidden(1.0, "mm", "the contact's centroid trails the tip along the motion"),
    "thermal_drift": Hidden(0.040, "s/h", "the latency itself creeps", signed=True),
    "frame_batching": Hidden(2.0, "frames", "frames arrive in groups, stamped at delivery", whole=True),
    "timestamp_quantisation": Hidden(0.006, "s", "stamps are whole multiples of a quantum"),
    "frame_drop": Hidden(0.15, "1", "this share of the frames never arrives"),
    "loss_of_contact": Hidden(
        0.4, "1/s", "contact is lost this often and the host fills the hole with a straight line"
    ),
    "second_filter_mode": Hidden(0.012, "s", "a second filter mode adds this latency while it is active"),
    "scan_skew": Hidden(0.008, "s", "latency grows by this much across the panel, left to right", signed=True),
    "pitch_ripple": Hidden(0.4, "mm", "position error periodic in the electrode pitch"),
    "smoothing_shrink": Hidden(0.035, "s", "a low-pass of this time constant that also shrinks circles"),
    "beam_wedge": Hidden(0.8, "mm", "the beam's apparent width grows by this across the screen", signed=True),
    "lagging_law": Hidden(0.060, "s", "the latency follows the speed of this long ago"),
    # In no library: the workflow must leave them unexplained.
    "split_panel": Hidden(0.008, "s", "latency steps at a vertical line on the panel", signed=True, in_library=False),
    "split_offset": Hidden(0.6, "mm", "y steps at a vertical line on the panel", signed=True, in_library=False),
    "settling": Hidden(0.015, "s", "latency decays to its law over the first seconds of contact", in_library=False),
    "speed_resonance": Hidden(0.010, "s", "a bump of latency around one speed", signed=True, in_library=False),
    "stalls": Hidden(0.045, "s", "delivery stalls this long every few seconds", in_library=False),
    "beam_sway": Hidden(0.7, "mm", "the beam sways slowly up and down", in_library=False),
    # As real screens, hosts and beams have them.
    "speed_adaptive_filter": Hidden(
        1.0, "Hz", "1 euro filter: least cut-off, which grows with the speed", inverse=True, realistic_only=True
    ),
    "prediction": Hidden(0.015, "s", "reports extrapolated by this much; taps are not", realistic_only=True),
    "deadband": Hidden(0.3, "mm", "small movements are held back", realistic_only=True),
    "warm_up": Hidden(0.012, "s", "latency lost as the screen gets warm", signed=True, realistic_only=True),
    "beam_bow": Hidden(0.55, "mm", "the beam is lower by this in the middle", signed=True, realistic_only=True),
    "poll_grid": Hidden(0.008, "s", "stamps wait for the host's next poll", realistic_only=True),
    "first_order_iir": Hidden(0.045, "s", "a first-order low-pass", in_library=False, realistic_only=True),
    "moving_average_by_speed": Hidden(
        0.16, "s", "moving average, its longest window; shorter with speed", in_library=False, realistic_only=True
    ),
    "alpha_beta_tracker": Hidden(
        0.012, "s", "alpha-beta tracker of this time constant", in_library=False, realistic_only=True
    ),
}

PLAIN = tuple(name for name, hidden in EFFECTS.items() if not hidden.realistic_only)
LIBRARY = tuple(name for name in PLAIN if EFFECTS[name].in_library)
UNKNOWN = tuple(name for name in PLAIN if not EFFECTS[name].in_library)
NEW = tuple(name for name, hidden in EFFECTS.items() if hidden.realistic_only and hidden.in_library)
REAL_LIBRARY = LIBRARY + NEW
REAL_UNKNOWN = tuple(name for name, hidden in EFFECTS.items() if hidden.realistic_only and not hidden.in_library)

ACCEPTED: dict[str, frozenset[str]] = {
    # A first-order low-pass is what the library calls by this name.
    "first_order_iir": frozenset({"smoothing_shrink"}),
    # A low-pass that gives way to speed.
    "moving_average_by_speed": frozenset({"speed_adaptive_filter"}),
}
"""Names of the library that are right for what is in no library."""


def draw_value(name: str, scale: float, rng: np.random.Generator) -> float:
    """A value of effect `name`: `scale` × nominal within ±10 %, random sign where both signs occur."""
    hidden = EFFECTS[name]
    factor = scale * rng.uniform(0.9, 1.1)
    if hidden.whole:
        return float(max(2, round(hidden.nominal * scale + rng.uniform(-0.2, 0.7))))
    value = hidden.nominal / factor if hidden.inverse else hidden.nominal * factor
    return float(value * (rng.choice((-1.0, 1.0)) if hidden.signed else 1.0))
