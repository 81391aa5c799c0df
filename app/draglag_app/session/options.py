"""Options of a session in addition to its protocol and its sources."""

from __future__ import annotations

from dataclasses import dataclass, field

from draglag.recording import Beam, Screen, Stylus, TouchCalibration


@dataclass(frozen=True)
class SessionOptions:
    """Options of a session in addition to its protocol. ``seed`` None: that of the protocol."""

    screen: Screen
    stylus: Stylus = field(default_factory=lambda: Stylus(7.0))
    beam: Beam | None = None
    seed: int | None = None
    countdown_s: float = 3.0
    name: str = ""
    note: str = ""
    calibration: TouchCalibration | None = None
