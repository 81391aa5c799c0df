"""Intervals of an effect's size next to what is too small to be named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core import sound_sessions
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.state import Term
from draglag.gap.posterior import linear, misfit
from draglag.gap.posterior.misfit import misfit_sd, parameters_with_misfit
from draglag.gap.traces.run_data import gather
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

DELAY_S = 0.0018


def fit_of_first(*hidden: str) -> Fit:
    """Fit of a session with several effects, of the first of them."""
    effects = [parse_effect(text) for text in hidden]
    session = simulate_session("screen-1", sound_sessions.brief_protocol(), effects=effects, seed=5)
    return fit_session(session, gather(session), [Term(effects[0].id)])


@pytest.fixture(scope="module")
def alone() -> Fit:
    return fit_of_first(f"laser_hysteresis={DELAY_S}")


@pytest.fixture(scope="module")
def in_a_wide_beam() -> Fit:
    """A shadow wider by 0.06 mm moves edges by 0.03 mm RMS: it has no name, and takes from the hysteresis."""
    return fit_of_first(f"laser_hysteresis={DELAY_S}", "beam_width=0.06")


def test_an_interval_holds_what_a_tolerated_effect_does_to_a_size(in_a_wide_beam: Fit) -> None:
    value, (low, high) = parameters_of("laser_hysteresis", in_a_wide_beam)["delay_s"]
    assert not low < DELAY_S < high  # noise alone does not explain it
    again, (low, high) = parameters_with_misfit("laser_hysteresis", in_a_wide_beam)["delay_s"]
    assert low < DELAY_S < high
    assert again == value


def test_where_the_edges_show_no_misfit_intervals_stay(alone: Fit) -> None:
    """To a quarter: scales up to 1 µm are not excluded by the noise."""
    _, (low, high) = parameters_of("laser_hysteresis", alone)["delay_s"]
    value, (wide_low, wide_high) = parameters_with_misfit("laser_hysteresis", alone)["delay_s"]
    assert high - low <= wide_high - wide_low < 1.25 * (high - low)
    assert wide_low < DELAY_S < wide_high
    assert value == pytest.approx(DELAY_S, abs=1e-4)


def test_without_any_scale_the_deviation_is_the_fits_own(alone: Fit) -> None:
    np.testing.assert_allclose(misfit_sd(alone, (0.0,)), np.sqrt(np.diag(alone.covariance)), rtol=1e-3)


def test_an_effect_is_no_misfit_of_its_own(alone: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    tolerated = []
    monkeypatch.setattr(
        misfit, "tolerance_of", lambda fit, members: tolerated.extend(members) or linear.tolerance_of(fit, members)
    )
    misfit_sd(alone, (0.0, 0.005))
    names = {member.name for member in tolerated}
    assert "beam_width" in names
    assert "laser_hysteresis" not in names


def test_columns_that_are_alike_leave_the_others_known(alone: Fit) -> None:
    twice = replace(
        alone,
        terms=(*alone.terms, *alone.terms),
        design=np.column_stack([alone.design, alone.design[:, -1:]]),
        prior=np.append(alone.prior, alone.prior[-1:]),
    )
    both, one = misfit_sd(twice), misfit_sd(alone)
    np.testing.assert_allclose(both[: one.size - 1], one[:-1], rtol=0.05)
    assert both[-1] > 100 * one[-1]
