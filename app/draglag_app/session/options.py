"""Options of a session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from draglag.recording import Beam, Screen, Stylus, TouchCalibration

COUNTDOWN_S = 3.0
"""A target stands still for so long before it moves."""


@dataclass(frozen=True)
class SessionOptions:
    """Options of a session; ``seed`` None: the protocol's."""

    screen: Screen
    stylus: Stylus = field(default_factory=lambda: Stylus(7.0))
    beam: Beam | None = None
    seed: int | None = None
    countdown_s: float = COUNTDOWN_S
    name: str = ""
    note: str = ""
    details: Mapping[str, str] = field(default_factory=dict)
    calibration: TouchCalibration | None = None
