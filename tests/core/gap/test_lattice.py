"""Whole coordinates that a calibration has turned and sheared are neither held nor filled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import brief_protocol, with_touch
from draglag.gap import close_gap
from draglag.gap.check import compared_statistics
from draglag.gap.replaying.replay import replay
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.lattice import basis_of, is_turned, lengths_mm
from draglag.recording import Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.rig import rig_for_screen

STEP_MM = 0.1
TURNED = np.array([[np.cos(0.02), -np.sin(0.02)], [np.sin(0.03), np.cos(0.03)]])  # and sheared by 10 mrad


def calibrated(touch: TouchTrace) -> TouchTrace:
    x_mm, y_mm = TURNED @ np.array([touch.x_mm, touch.y_mm])
    return replace(touch, x_mm=x_mm, y_mm=y_mm)


@pytest.fixture(scope="module")
def whole() -> Session:
    panel = replace(rig_for_screen("screen-1"), resolution_mm=STEP_MM)
    return simulate_session(panel, brief_protocol(), seed=5)


def test_steps_are_found_in_turned_coordinates(whole: Session) -> None:
    turned = with_touch(whole, calibrated)
    for session, across in ((whole, False), (turned, True)):
        basis = basis_of([run.touch for run in session.runs])
        assert basis is not None
        assert is_turned(basis) is across
        expected_mm = STEP_MM * (np.hypot(*TURNED) if across else np.ones(2))
        assert lengths_mm(basis) == pytest.approx(tuple(expected_mm), abs=2e-6)
    assert inspect(turned)[0] == ()
    assert all(a is b for a, b in zip(inspect(turned)[1].runs, turned.runs, strict=True))


@pytest.mark.parametrize("decimals", [3, 4])
def test_turned_steps_are_found_behind_a_file_s_decimals(whole: Session, decimals: int) -> None:
    def written(touch: TouchTrace) -> TouchTrace:
        turned = calibrated(touch)
        return replace(turned, x_mm=np.round(turned.x_mm, decimals), y_mm=np.round(turned.y_mm, decimals))

    session = with_touch(whole, written)
    basis = basis_of([run.touch for run in session.runs])
    assert basis is not None
    assert lengths_mm(basis) == pytest.approx(tuple(STEP_MM * np.hypot(*TURNED)), rel=1e-3)
    assert inspect(session)[0] == ()


def test_positions_without_whole_steps_have_none() -> None:
    panel = replace(rig_for_screen("screen-1"), resolution_mm=0.0)
    session = simulate_session(panel, brief_protocol(), seed=5)
    assert basis_of([run.touch for run in session.runs]) is None


def filled(change: Callable[[TouchTrace], TouchTrace]) -> Callable[[TouchTrace], TouchTrace]:
    """Ten losses of 0.15 s, each filled with a line, before or after the calibration."""

    def lossy(touch: TouchTrace) -> TouchTrace:
        t_s = touch.t_s - touch.t_s[0]
        away = (t_s % 1.4 < 0.15) & (t_s > 0.2) & (t_s < t_s[-1] - 0.2)
        x_mm, y_mm = (np.interp(t_s, t_s[~away], values[~away]) for values in (touch.x_mm, touch.y_mm))
        return change(replace(touch, x_mm=x_mm, y_mm=y_mm))

    return lossy


def test_losses_are_filled_on_turned_coordinates_as_on_others(whole: Session) -> None:
    plain, turned = (inspect(with_touch(whole, filled(change))) for change in (lambda touch: touch, calibrated))
    assert [one.effect for one in turned[0]] == [one.effect for one in plain[0]] == ["loss_of_contact"]
    assert turned[0][0].value == pytest.approx(plain[0][0].value, rel=0.02)
    for a, b in zip(plain[1].runs, turned[1].runs, strict=True):
        kept = np.isin(b.touch.t_s, a.touch.t_s)
        assert np.mean(kept) > 0.98
        there = calibrated(a.touch)
        at = np.isin(a.touch.t_s, b.touch.t_s)
        assert b.touch.x_mm[kept] == pytest.approx(there.x_mm[at], abs=1e-9)


def test_repeats_of_turned_steps_agree_with_the_simulation_s(whole: Session) -> None:
    coarse = simulate_session(
        replace(rig_for_screen("screen-1"), resolution_mm=0.4, touch_rate_hz=360.0), brief_protocol(), seed=5
    )
    session = with_touch(coarse, calibrated)
    last = close_gap(session, max_effects=0).last
    assert last is not None
    (share,) = [
        one for one in compared_statistics(session, replay(session, last, {})) if one.name == "repeated positions"
    ]
    assert share.measured > 0.05
    assert share.agrees
