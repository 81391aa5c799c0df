"""The draw of a realistic rig: screen, law, digitiser, beam, sensor, protocol."""

import numpy as np

from ..law import FORMS, VELOCITY, Law, draw_law, draw_transport
from ..rig import SCREENS, Profile, Rig, draw_plan, stream
from .beam import MISSED, Sensor

RATES_HZ = (60, 85, 100, 120, 133, 166, 240, 500, 1000)
JITTER = 0.03  # of the scan's period
CENTROID_SD_MM = 0.05  # from run to run, with the stylus' tilt
CALIBRATION_SD_MM = 0.02


def draw_real_rig(seed: int, profile: Profile) -> Rig:
    """Draw everything that is set before anything moves; noise of 0 also means no rounding and no missed pass."""
    rng = stream(seed, "real rig")
    screen = SCREENS[rng.integers(len(SCREENS))]
    _, width, height, *_ = screen
    slope = float(np.tan(np.radians(rng.uniform(-1, 1))))
    intercept = height * rng.uniform(0.46, 0.54) - slope * width / 2
    sensor = Sensor(rng.uniform(0.15, 0.4), rng.uniform(0.2, 0.5), rng.uniform(0.005, 0.02))
    stated = float(rng.choice([5.0, 6.0, 7.0, 7.0, 8.0, 9.0]))
    rate = float(rng.choice(RATES_HZ)) * (1 + rng.normal(0, 3e-4))
    scans = 1 if profile.scan_hz is None else max(1, round(profile.scan_hz / rate))
    taps = profile.taps if profile.taps != "random" else str(rng.choice(["end", "both"], p=[0.6, 0.4]))
    n_taps = int(rng.integers(60, 101))
    before = n_taps // 2 if taps == "both" else 0
    noisy = profile.noise > 0
    return Rig(
        screen=screen,
        diameter_mm=stated,
        law=_law(seed, profile),
        rate_hz=rate,
        scan_jitter_s=JITTER / rate / scans * min(profile.noise, 1.0),
        noise_mm=rng.uniform(0.05, 0.2) * profile.noise,
        noise_correlation=0.0,
        correlated_share=0.0,
        speed_window_s=0.05,
        catch_up=0.03,
        run_latency_sd_s=0.0,
        run_offset_sd_mm=CENTROID_SD_MM * profile.noise,
        loss_rate_hz=0.0,
        beam_slope=slope,
        beam_intercept_mm=float(intercept),
        sensor_s=sensor.response_s,
        hand={},
        plan=draw_plan(
            stream(seed, "plan"), profile, width, height, slope * width / 2 + intercept, taps == "both", before
        ),
        taps_before=before,
        taps_after=0 if taps == "none" else n_taps - before,
        tap={
            "release_s": float(rng.normal(0.0006, 0.0003)),
            "touch_extra_s": float(rng.uniform(0.002, 0.008)),
            "sd_s": float(rng.uniform(0.0025, 0.004)),
        },
        world="realistic",
        sensor=sensor,
        # A width that is off is an effect; a sound laboratory measures it on the beam itself.
        disc_mm=stated - sensor.widens_mm + CALIBRATION_SD_MM * float(rng.normal()),
        beam_bow_mm=0.03 * rng.uniform(-1, 1),
        step_mm=rng.uniform(0.01, 0.1) * float(noisy),
        scans_per_report=scans,
        missed_share=MISSED * float(noisy),
        velocity_window_s=stream(seed, "velocity").uniform(0.01, 0.02) if profile.law_form == VELOCITY else 0.0,
    )


def own_sizes(rig: Rig) -> dict[str, float]:
    """What a sound rig has of the kinds of effects by itself: it adds to what is hidden."""
    if rig.sensor is None:
        return {}
    return {"beam_width": rig.disc_mm + rig.sensor.widens_mm - rig.diameter_mm, "beam_bow": rig.beam_bow_mm}


def _law(seed: int, profile: Profile) -> Law:
    rng = stream(seed, "law")
    if profile.law_form == "transport":
        return draw_transport(rng)
    if profile.law_form == VELOCITY:
        return draw_law(rng, "double")
    form = profile.law_form or str(stream(seed, "law form").choice(FORMS))
    return draw_law(rng, form)
