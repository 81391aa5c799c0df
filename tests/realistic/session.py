"""A whole session as the library's own Session, with the true latency of every run."""

import numpy as np
from tests.blind.physics.law import draw_law
from tests.blind.physics.real import hand
from tests.blind.physics.real.beam import Sensor

from draglag.recording import LaserTrace, Run, Screen, Session, Stylus, TouchTrace

from . import rig

DIAMETER_MM = 7.0
SPEEDS_MM_S = (45.0, 55.0, 70.0, 90.0, 115.0, 140.0, 170.0, 200.0, 290.0, 420.0, 620.0, 900.0)


MOST_A_POLL = 1.1  # reports
SCAN_JITTER_S = 1e-4  # of digitisers on polled buses


def make_session(
    seed: int, form: str, duration_s: float = 25.0, poll_s: float | None = None
) -> tuple[Session, dict[str, float]]:
    """Run id -> mean true latency over its edges, s, of one session of circles at twelve speeds.

    poll_s: of the bus; None: reports come at once.
    """
    rng = np.random.default_rng([seed, 4711])
    sensor = Sensor(rng.uniform(0.15, 0.4), rng.uniform(0.2, 0.5), rng.uniform(0.005, 0.02))
    law, rate_hz = draw_law(rng, form), float(rng.choice([90, 100, 120, 133, 166, 240]))
    if poll_s is not None and poll_s * rate_hz > MOST_A_POLL:
        poll_s = 0.001  # a bus that fits the digitiser
    panel = rig.Panel(
        law,
        rate_hz,
        rng.uniform(0.05, 0.2),
        rng.uniform(0.01, 0.1),
        3e-5 if poll_s is None else SCAN_JITTER_S,
        poll_s or 0.0,
    )
    beam = (float(np.tan(np.radians(rng.uniform(-1, 1)))), 130.0, 0.03 * rng.uniform(-1, 1))
    runs, truth, start_s = [], {}, 10.0
    for k, speed in enumerate(rng.permutation(SPEEDS_MM_S)):
        radius = 22.0 if speed < 300 else 50.0
        motion = hand.drag(rng, float(speed), radius, duration_s, (150.0, 130.0 + rng.uniform(-4, 4)), 120.0)
        # The contact's centroid moves with the stylus' tilt, by run.
        shift_mm = 0.05 * rng.normal(size=2)
        span_s = (0.0, duration_s)
        tau, x, y, behind = rig.reports(rng, panel, motion, span_s)
        stamp, light, ideal = rig.edges(rng, sensor, motion, DIAMETER_MM, beam, span_s)
        run_id = f"run-{k + 1:02d}"
        truth[run_id] = float(np.interp(ideal, motion.t_s, behind).mean()) if ideal.size else float("nan")
        runs.append(
            Run(
                run_id,
                "circle",
                start_s,
                duration_s,
                TouchTrace(tau + start_s, x + shift_mm[0], y + shift_mm[1]),
                LaserTrace(stamp + start_s, light.astype(np.int64)),
                nominal_speed_mm_s=float(speed),
                radius_mm=radius,
            )
        )
        start_s += duration_s + 12.0
    screen = Screen("realistic", 300.0, 260.0, 1920, 1080)
    return Session(f"realistic {seed}", screen, Stylus(DIAMETER_MM), tuple(runs)), truth
