"""Everything about one rig and one day that is drawn at random before anything moves."""

import zlib
from dataclasses import dataclass, field

import numpy as np

from .law import Law, draw_law
from .real.beam import Sensor

# name, width mm, height mm, width px, height px
SCREENS = (
    ("tablet 10in", 217.0, 135.6, 1280, 800),
    ("panel 12in 4:3", 246.0, 184.5, 1024, 768),
    ("laptop 13in", 293.8, 165.2, 1920, 1080),
    ("monitor 15in 4:3", 304.1, 228.1, 1024, 768),
    ("laptop 15in", 344.2, 193.6, 1920, 1080),
    ("monitor 17in 5:4", 337.9, 270.3, 1280, 1024),
    ("monitor 22in", 476.6, 268.1, 1920, 1080),
    ("monitor 23in", 509.2, 286.4, 1920, 1080),
    ("monitor 24in", 531.4, 298.9, 1920, 1080),
    ("monitor 27in", 597.7, 336.2, 2560, 1440),
)


def stream(seed: int, name: str) -> np.random.Generator:
    """A generator per cause, so that adding an effect changes no other draw."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


@dataclass(frozen=True)
class Profile:
    """Limits of the draw.

    `noise`, `hand` scale the digitiser's noise and the hand's faults. `protocol`: "speeds" is 12–16 shuffled circle
    speeds, "repeats" fewer speeds several times, "random" either. `between_runs` None: drawn whether runs have their
    own latency and offset; `taps`: "end", "both", "none" or "random".
    """

    noise: float = 1.0
    hand: float = 1.0
    protocol: str = "random"
    between_runs: bool | None = None
    taps: str = "random"
    off_beam: bool | None = None
    varied_runs: bool | None = None
    losses: bool | None = None
    run_s: float | None = None
    n_speeds: int | None = None
    world: str = "plain"
    """plain or realistic: which hand, beam and screen."""
    law_form: str | None = None
    """One of `law.FORMS`, "transport", or "velocity": "double" of the size of a mean velocity, in the realistic world.
    None is Eq. 5 in the plain world, and drawn in the realistic one."""
    scan_hz: float | None = None
    """At least this many scans a second go through the panel's filters, whatever it reports."""


@dataclass(frozen=True)
class RunPlan:
    id: str
    protocol: str
    nominal_speed_mm_s: float | None
    radius_mm: float
    centre_off_beam_mm: float
    clockwise: bool
    duration_s: float
    start_s: float


@dataclass(frozen=True)
class Rig:
    screen: tuple[str, float, float, int, int]
    diameter_mm: float
    law: Law
    rate_hz: float
    scan_jitter_s: float
    noise_mm: float
    noise_correlation: float
    correlated_share: float
    speed_window_s: float
    catch_up: float
    run_latency_sd_s: float
    run_offset_sd_mm: float
    loss_rate_hz: float
    beam_slope: float
    beam_intercept_mm: float
    sensor_s: float
    hand: dict[str, float]
    plan: tuple[RunPlan, ...]
    taps_before: int
    taps_after: int
    tap: dict[str, float] = field(default_factory=dict)
    world: str = "plain"
    sensor: Sensor | None = None
    """None: a beam without width, as the plain world has it."""
    disc_mm: float | None = None
    """Of the stylus itself, where the session states what a calibration on the beam made of it."""
    beam_bow_mm: float = 0.0
    step_mm: float = 0.0
    scans_per_report: int = 1
    missed_share: float = 0.0
    velocity_window_s: float = 0.0
    """Standard deviation of the window of a mean velocity whose size the law follows; 0: of the speed, see above."""


def draw_rig(seed: int, profile: Profile) -> Rig:
    """Draw screen, stylus, law, digitiser, beam, hand and protocol."""
    rng = stream(seed, "rig")
    screen = SCREENS[rng.integers(len(SCREENS))]
    _, width, height, *_ = screen
    slope = rng.uniform(-0.01, 0.01)
    intercept = height * rng.uniform(0.44, 0.56) - slope * width / 2
    if rng.random() < 0.6:  # like Screen 1: two rates of similar weight
        law = {"a1": rng.uniform(0.02, 0.1), "a2": rng.uniform(0.003, 0.005), "a4": rng.uniform(0.11, 0.2)}
        law |= {"a5": rng.uniform(0.019, 0.03), "a7": rng.uniform(0.025, 0.035)}
    else:  # like Screen 2: one steep part, a small slow one
        law = {"a1": rng.uniform(0.008, 0.03), "a2": rng.uniform(0.0028, 0.005), "a4": rng.uniform(0.19, 0.24)}
        law |= {"a5": rng.uniform(0.017, 0.021), "a7": rng.uniform(0.022, 0.032)}
    between = profile.between_runs if profile.between_runs is not None else rng.random() < 0.65
    correlated = rng.random() < 0.5
    losses = profile.losses if profile.losses is not None else rng.random() < 0.35
    hand = {
        "natural_hz": rng.uniform(4.5, 7.0),
        "fastest_hz": rng.uniform(2.5, 3.6),
        "wander_mm": rng.uniform(1.0, 3.0) * profile.hand,
        "wander_hz": rng.uniform(0.25, 0.6),
        "tremor_mm": rng.uniform(0.05, 0.13) * profile.hand,
        "tremor_hz": rng.uniform(8.5, 11.5),
        "uneven": rng.uniform(0.02, 0.05) * profile.hand,
        "preference": rng.uniform(0.01, 0.06) * profile.hand,
        "preferred_rad": rng.uniform(0, np.pi),
    }
    taps = profile.taps if profile.taps != "random" else str(rng.choice(["end", "both"], p=[0.6, 0.4]))
    n_taps = int(rng.integers(60, 101))
    before = n_taps // 2 if taps == "both" else 0
    after = 0 if taps == "none" else n_taps - before
    return Rig(
        screen=screen,
        diameter_mm=float(rng.choice([5.0, 6.0, 7.0, 7.0, 8.0, 9.0])),
        law=_plain_law(seed, profile, law),
        rate_hz=float(rng.choice([85, 100, 110, 120, 133, 144, 165, 200])) * (1 + rng.normal(0, 3e-5)),
        scan_jitter_s=rng.uniform(0.00005, 0.00015) * min(profile.noise, 1.0),
        noise_mm=rng.uniform(0.1, 0.3) * profile.noise,
        noise_correlation=rng.uniform(0.2, 0.5) if correlated else 0.0,
        correlated_share=rng.uniform(0.2, 0.5) if correlated else 0.0,
        speed_window_s=rng.uniform(0.045, 0.065),
        catch_up=rng.uniform(0.01, 0.05),
        run_latency_sd_s=rng.uniform(0.0003, 0.0007) * profile.noise if between else 0.0,
        run_offset_sd_mm=rng.uniform(0.02, 0.04) * profile.noise if between else 0.0,
        loss_rate_hz=rng.uniform(0.01, 0.05) if losses else 0.0,
        beam_slope=slope,
        beam_intercept_mm=intercept,
        sensor_s=55e-6,
        hand={key: float(value) for key, value in hand.items()},
        plan=draw_plan(
            stream(seed, "plan"), profile, width, height, slope * width / 2 + intercept, taps == "both", before
        ),
        taps_before=before,
        taps_after=after,
        tap={
            "release_s": rng.normal(0.0006, 0.0003),
            "touch_extra_s": rng.uniform(0.002, 0.008),
            "sd_s": rng.uniform(0.0025, 0.004),
        },
    )


def _plain_law(seed: int, profile: Profile, eq5: dict[str, float]) -> Law:
    if profile.law_form in (None, "double"):
        return Law("double", {key: float(value) for key, value in eq5.items()})
    return draw_law(stream(seed, "law"), str(profile.law_form))


def draw_plan(
    rng: np.random.Generator,
    profile: Profile,
    width: float,
    height: float,
    beam_mm: float,
    early_taps: bool,
    before: int,
) -> tuple[RunPlan, ...]:
    kind = profile.protocol if profile.protocol != "random" else str(rng.choice(["speeds", "repeats"], p=[0.75, 0.25]))
    if kind == "speeds":
        n = profile.n_speeds or int(rng.integers(12, 17))
        speeds = np.geomspace(44.0, 1000.0, n) * np.exp(rng.normal(0, 0.03, n))
    else:
        n = profile.n_speeds or int(rng.integers(5, 8))
        speeds = np.repeat(np.geomspace(rng.uniform(44, 60), rng.uniform(700, 1000), n), int(rng.integers(2, 4)))
    speeds = rng.permutation(np.clip(speeds, 40.0, 1050.0))
    duration = profile.run_s or float(rng.choice([25, 30, 35, 40]))
    room = min(beam_mm, height - beam_mm) - 14.0
    small, large = min(0.1 * width, 0.6 * room), min(0.2 * width, room)
    off = profile.off_beam if profile.off_beam is not None else rng.random() < 0.5
    jobs: list[tuple[str, float | None, float, float, float]] = []
    for speed in speeds:
        radius = large if speed > 380 else small
        spare = min(30.0, room - radius, 0.6 * radius)
        shift = rng.uniform(-spare, spare) if off and spare > 5 and rng.random() < 0.5 else 0.0
        jobs.append(("circle", float(speed), radius, shift, duration))
    varied = profile.varied_runs
    if varied or (varied is None and rng.random() < 0.6):
        jobs.append(("chirp", None, small, 0.0, 80.0 if duration > 30 else 60.0))
    if varied or (varied is None and rng.random() < 0.5):
        jobs.append(("step", None, small, 0.0, 40.0))
    if varied is None and rng.random() < 0.3:
        jobs.append(("multisine", None, small, 0.0, 45.0))
    plan, start = [], 0.0
    if early_taps:
        start = before * 0.72 + 10.0
    for k, (protocol, speed, radius, shift, length) in enumerate(jobs):
        plan.append(
            RunPlan(f"run-{k + 1:02d}", protocol, speed, radius, shift, bool(rng.random() < 0.5), length, start)
        )
        start += length + rng.uniform(10.0, 24.0)
    return tuple(plan)
