"""Touch events far off the path, as of drivers that report zeros, move no estimate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import recorded, with_touch
from draglag.analysis import analyze
from draglag.path.events import strays
from draglag.recording import Session, TouchTrace


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


def test_single_zeros_are_left_out_and_said(sound: Session) -> None:
    """Two in a thousand: latencies were up to 33 ms off."""
    rng = np.random.default_rng(4)

    def with_zeros(touch: TouchTrace) -> TouchTrace:
        zero = rng.random(touch.t_s.size) < 0.002
        return replace(touch, x_mm=np.where(zero, 0.0, touch.x_mm), y_mm=np.where(zero, 0.0, touch.y_mm))

    found, clean = analyze(with_touch(sound, with_zeros)), analyze(sound)
    for one, other in zip(found.runs, clean.runs, strict=True):
        if other.latency_s is None:
            continue
        assert "stray_touches" in one.flags
        assert "stray_touches" not in other.flags
        assert other.latency_se_s is not None
        assert one.latency_s == pytest.approx(other.latency_s, abs=0.3 * other.latency_se_s)


def test_two_contacts_in_turn_are_no_strays() -> None:
    t_s = 0.008 * np.arange(400)
    other = np.arange(400) % 2 * 80.0
    assert not strays(TouchTrace(t_s, 30 * np.cos(t_s) + other, 30 * np.sin(t_s))).any()


def test_the_fastest_hands_are_no_strays() -> None:
    """3 m/s there and back across a panel of 60 frames a second."""
    t_s = np.arange(0.0, 10.0, 1 / 60)
    assert not strays(TouchTrace(t_s, 150 + 150 * np.sin(20 * t_s), 100 + 0 * t_s)).any()
