"""What the WALT's sensors see over time, for setting the rig up, and its other one-shot readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray
from draglag_devices.source import DeviceError
from draglag_devices.walt.link import Link, NoAnswer
from draglag_devices.walt.protocol import (
    ACCELEROMETER,
    BRIGHTNESS,
    LASER_LAST,
    RAW_ADC,
    SCREEN_LAST,
    Trigger,
    acknowledgement,
    parse_adc,
    parse_sample,
)

# The firmware blocks for about this long; twice that is patience enough.
_LASTS_S = {BRIGHTNESS: 1.0, ACCELEROMETER: 2.0}
SAMPLES = {BRIGHTNESS: 1000, ACCELEROMETER: 4000}
# Above this of 1023 the firmware takes the accelerometer's reading for a shock.
SHOCK_ADC = 900
_END = (0, -1)  # no sample: ADC counts are not negative


@dataclass(frozen=True)
class SensorCurve:
    """Samples of one sensor: seconds since the first, and ADC counts 0 to 1023. ``lost`` lines were unreadable."""

    t_s: FloatArray
    adc: FloatArray
    lost: int = 0


def brightness_curve(link: Link) -> SensorCurve:
    """The screen's photodiode over about 1 s, 1000 samples. Blocks the WALT. Raises PortGone, DeviceError."""
    return _curve(link, BRIGHTNESS)


def accelerometer_curve(link: Link) -> SensorCurve:
    """The accelerometer over about 2 s, 4000 samples. Blocks the WALT. Raises PortGone, DeviceError."""
    return _curve(link, ACCELEROMETER)


def sensor_levels(link: Link) -> dict[str, int]:
    """What the ADCs read now: G, PD_screen, PD_laser, 0 to 1023. Raises PortGone, NoAnswer."""
    return link.ask(RAW_ADC, parse_adc).value


def last_laser(link: Link) -> Trigger | None:
    """The last change of the laser, or None where the answer was lost. Raises PortGone."""
    return _last(link, LASER_LAST, "L")


def last_screen(link: Link) -> Trigger | None:
    """The last change of the screen's photodiode, or None where the answer was lost. Raises PortGone."""
    return _last(link, SCREEN_LAST, "S")


def _last(link: Link, command: str, tag: str) -> Trigger | None:
    # The answer has the form of an unasked trigger line; the ping behind it says that it must have come.
    link.send(command)
    try:
        link.settle()
    except NoAnswer:
        return None
    found = [trigger for trigger in link.take_triggers() if trigger.tag == tag]
    return found[-1] if found else None


def _sample_or_end(text: str) -> tuple[int, int] | None:
    return _END if text == "end" else parse_sample(text)


def _curve(link: Link, command: str) -> SensorCurve:
    patience_s = 2 * _LASTS_S[command] + 1.0
    wanted = acknowledgement(command)
    samples: list[tuple[int, int]] = []
    before = link.unread
    try:
        link.ask(command, lambda text: text if text == wanted else None, patience_s)
        while True:
            sample, _ = link.expect(_sample_or_end, patience_s)
            if sample == _END:
                break
            samples.append(sample)
    except NoAnswer:
        raise DeviceError("serial:", "the WALT stopped in the middle of a curve", "unplug it and try again") from None
    if not samples:
        raise DeviceError("serial:", "the WALT sent a curve without samples", "check its sensors")
    table = np.array(samples, np.float64)
    # Differences of 32-bit counts, so that a wrap in the middle does no harm.
    steps = (np.diff(table[:, 0]) + (1 << 31)) % (1 << 32) - (1 << 31)
    t_s = np.concatenate(([0.0], np.cumsum(steps))) * 1e-6
    return SensorCurve(t_s, table[:, 1], link.unread - before)
