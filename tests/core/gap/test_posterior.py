"""The posterior over explanations: its evidence against the textbook's formula, and what it makes of known sessions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from core import sound_sessions
from draglag.gap import GapReport, close_gap, constants
from draglag.gap.fitting.heldout import gap_mm
from draglag.gap.fitting.joint import fit_session
from draglag.gap.fitting.law_form import flexible, knots_over, nearest_eq5, remainder_rms_s
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.noise import Components, Scatter
from draglag.gap.fitting.state import Term
from draglag.gap.posterior.levels import PARTS, log_prior
from draglag.gap.posterior.linear import Linear, likeliest_levels, linearised, normal
from draglag.gap.posterior.members import Member, of_unit_rms
from draglag.gap.posterior.pool import compared, likely_levels
from draglag.gap.posterior.search import log_evidence, searched, sizes_mm
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

SINGULAR = 1.5  # of the tolerated direction
LEVELS = Components(slow_mm=0.1, run_s=0.0, run_mm=0.0, late_s=0.0005, misfit_mm=0.005)


def linear(
    rng: np.random.Generator, residual_mm: np.ndarray, members: tuple[Member, ...], own: tuple[str, ...] = ()
) -> Linear:
    """A session of one run at a fit with ``own`` effects: a constant and one tolerated shape as its base."""
    n = residual_mm.size
    zero = np.zeros((1, n))
    parts = Scatter(
        np.full((1, n), 0.01), np.ones((1, n)), zero, zero, rng.uniform(50, 300, n), np.zeros(n),
        np.zeros(n, np.int64), np.zeros(1), np.arange(n, dtype=float),
    )  # fmt: skip
    columns = np.column_stack([of_unit_rms(m.columns) for m in members])
    at = tuple(np.array([k]) for k in range(len(members)))
    law = LawParameters(0.05, 4e-3, 0.05, 2e-2, 0.03)
    fit = cast("object", SimpleNamespace(terms=tuple(map(Term, own)), law=law))
    return Linear(
        fit,
        members,
        residual_mm,
        np.column_stack([np.ones(n), np.linspace(-1.7, 1.7, n)]),
        np.array([4.0]),
        columns,
        at,
        parts,
        False,
        law,
        None,
        cast("object", SimpleNamespace(singular=np.array([SINGULAR]))),
    )  # type: ignore[arg-type]


def test_the_evidence_of_every_set_is_the_marginal_likelihood_of_its_gaussian_model() -> None:
    """Base and members integrated out by hand (Rasmussen & Williams, eq. 2.30).

    r ~ N(0, C + A P⁻¹ Aᵀ + (τ² σ² + ρ²) T Tᵀ + Σ s² x xᵀ).
    """
    rng = np.random.default_rng(1)
    n = 40
    members = tuple(Member(name, (), rng.standard_normal((n, 1)), np.log(0.02)) for name in ("one", "two"))
    residual_mm = 0.3 * members[0].columns[:, 0] + 0.1 * rng.standard_normal(n)
    seen = linear(rng, residual_mm, members)
    local = 0.01 + LEVELS.slow_mm**2 + (LEVELS.late_s * seen.parts.late_mm_s) ** 2
    tolerated_mm2 = (SINGULAR * LEVELS.misfit_mm) ** 2 + constants.ROUNDING_MM**2
    covariance = np.diag(local) + seen.base @ np.diag([1 / 4.0, tolerated_mm2]) @ seen.base.T
    found = {e.members: e for e in searched(seen, (normal(seen, LEVELS),)).explanations}
    constant = multivariate_normal(np.zeros(n), covariance).logpdf(residual_mm) + log_prior(LEVELS, False)
    for k in range(2):
        x = seen.columns[:, [k]]
        each = [
            multivariate_normal(np.zeros(n), covariance + s**2 * x @ x.T).logpdf(residual_mm) for s in constants.SLAB_MM
        ]
        mass = logsumexp(each) - np.log(len(each)) + log_prior(LEVELS, False) + np.log(0.02)
        gained = mass - constant
        assert found[k,].log_mass - found[()].log_mass == pytest.approx(gained, abs=1e-6)
    assert found[0,].log_mass > found[()].log_mass > found[1,].log_mass


def test_a_fit_s_own_effects_are_judged_there_although_others_look_more_probable() -> None:
    """Undone in the traces, the columns of its own effects explain nothing more: others fill the beam before them."""
    rng = np.random.default_rng(4)
    own = ("scan_skew", "spatial_warp")
    members = tuple(Member(name, (), rng.standard_normal((200, 1)), np.log(0.02)) for name in (*own, *"abcdefgh"))
    others = np.column_stack([m.columns for m in members[2:]])
    residual_mm = others @ rng.uniform(0.3, 0.5, 8) + 0.1 * rng.standard_normal(200)
    judged = linear(rng, residual_mm, members, own)
    search = searched(judged, (normal(judged, LEVELS),))
    sets = [search.names(one) for one in search.explanations]
    assert own in sets
    assert any(set(own) < set(names) for names in sets)
    without = linear(rng, residual_mm, members)
    assert own not in [search.names(one) for one in searched(without, (normal(without, LEVELS),)).explanations]


def test_the_size_of_a_member_is_that_of_its_share_of_the_residual() -> None:
    rng = np.random.default_rng(2)
    member = Member("one", (), rng.standard_normal((200, 1)), np.log(0.02))
    seen = linear(rng, 0.4 * of_unit_rms(member.columns)[:, 0] + 0.1 * rng.standard_normal(200), (member,))
    search = searched(seen, (normal(seen, LEVELS),))
    assert search.names(search.best) == ("one",)
    assert sizes_mm(search, search.best)["one"] == pytest.approx(0.4, abs=4 * 0.15 / np.sqrt(200))


def test_jumps_at_two_places_count_together() -> None:
    """Each member has its column; the smaller one must not stand for both."""
    rng = np.random.default_rng(5)
    n = 400
    first, second = rng.choice([-1.0, 1.0], (2, n))
    members = tuple(
        Member("?x:jump", (at,), column[:, None], np.log(0.02)) for at, column in ((1.0, first), (2.0, second))
    )
    residual_mm = 0.3 * first + 0.05 * second + 0.1 * rng.standard_normal(n)
    found = linear(rng, residual_mm, members)
    search = searched(found, (normal(found, LEVELS),))
    assert search.names(search.best) == ("?x:jump", "?x:jump")
    # Known to the noise of 0.14 mm over the root of 400.
    assert sizes_mm(search, search.best)["?x:jump"] == pytest.approx(np.hypot(0.3, 0.05), abs=4 * 0.14 / np.sqrt(n))


@pytest.mark.parametrize(("name", "left"), [("?x:offset", 0.3), ("named", 0.9)])
def test_of_what_has_no_name_counts_what_the_law_and_the_beam_cannot_be(name: str, left: float) -> None:
    rng = np.random.default_rng(3)
    n = 200
    shape = np.sqrt(0.9**2 - 0.3**2) + 0.3 * rng.standard_normal(n)  # most of it is the constant that the base has
    members = (Member(name, (), shape[:, None], np.log(0.02)),)
    seen = replace(linear(rng, shape + 0.05 * rng.standard_normal(n), members), precision=np.array([1e8]))
    search = searched(seen, (normal(seen, LEVELS),))
    # Known to the noise of 0.14 mm over the root of 200; the spread of the draw to 1 / sqrt(400).
    assert sizes_mm(search, search.best)[name] == pytest.approx(
        left, abs=4 * (0.14 / np.sqrt(n) + 0.3 / np.sqrt(2 * n))
    )


def test_of_what_has_no_name_counts_what_named_effects_of_the_explanation_cannot_be() -> None:
    """A smooth function of the acceleration holds most of an effect that follows it: their sum, not their shares, is
    known."""
    rng = np.random.default_rng(6)
    n = 400
    effect, rest = rng.standard_normal((2, n))
    members = tuple(
        Member(name, (), column[:, None], np.log(0.02))
        for name, column in (("effect", effect), ("?acceleration:latency", 3 * effect + rest))
    )
    seen = linear(rng, effect + 0.2 * rest + 0.1 * rng.standard_normal(n), members)
    search = searched(seen, (normal(seen, LEVELS),))
    both = max((e for e in search.explanations if e.members == (0, 1)), key=lambda e: e.log_mass)
    assert sizes_mm(search, both)["?acceleration:latency"] == pytest.approx(0.2, abs=4 * 0.14 / np.sqrt(n))


def test_a_curve_of_another_form_has_a_nearest_eq_5_and_a_remainder() -> None:
    v = np.geomspace(40, 900, 300)
    logistic_s = 0.03 + 0.05 / (1 + (v / 200) ** 4)
    law = flexible(LawParameters(0.05, 4e-3, 0.05, 2e-2, 0.03), knots_over(v))
    columns = law.columns(v)
    step = np.zeros(columns.shape[1])
    step[5:] = np.linalg.lstsq(columns[:, 5:], logistic_s - law(v), rcond=1e-6)[0]
    curve = law.moved(step)
    np.testing.assert_allclose(curve(v), logistic_s, atol=2e-4)
    assert remainder_rms_s(curve, v) > 1e-3  # no two exponentials follow it
    assert remainder_rms_s(nearest_eq5(curve, v), v) == 0.0


def closed(*effects: str) -> GapReport:
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs if r.kind == "circle")
    protocol = demo.model_copy(update={"runs": runs, "taps": None})
    hidden = [parse_effect(text) for text in effects]
    return close_gap(simulate_session("screen-1", protocol, effects=hidden, seed=3))


@pytest.fixture(scope="module")
def drifting() -> GapReport:
    return closed("clock_drift=60")


def test_a_drifting_clock_is_named_with_its_size_and_the_gap_closes(drifting: GapReport) -> None:
    assert drifting.verdict == "explained"
    (step,) = drifting.steps
    # Without taps a creeping latency moves every edge alike.
    assert {step.effect, *step.indistinguishable_from} == {"clock_drift", "thermal_drift"}
    low, high = step.parameters["drift_ppm"][1]
    assert low < 60.0 < high
    assert drifting.gap_first_mm is not None
    assert drifting.gap_last_mm is not None
    assert drifting.noise_floor_mm is not None
    assert drifting.gap_last_mm < 0.5 * drifting.gap_first_mm
    assert drifting.gap_last_mm < 1.6 * drifting.noise_floor_mm  # what noise leaves in single sessions
    assert drifting.law.adequate


def test_no_probability_is_stated_beyond_what_was_counted(drifting: GapReport) -> None:
    assert drifting.probability is not None
    assert 0.4 < drifting.probability <= constants.STATED_AT_MOST  # two names share it
    json = drifting.to_dict()
    assert json["explanations"][0]["effects"] == ["clock_drift"]  # type: ignore[index]
    assert json["steps"][0]["probability"] <= constants.STATED_AT_MOST  # type: ignore[index]


def test_a_sound_session_is_quiet() -> None:
    found = sound_sessions.report_of_recorded()
    assert (found.verdict, found.steps) == ("no_gap", ())
    assert found.gap_last_mm == found.gap_first_mm


@pytest.mark.parametrize(("extra_mm", "named"), [(0.07, []), (0.14, ["beam_width"])])
def test_an_effect_is_named_from_the_size_of_interest_on(extra_mm: float, named: list[str]) -> None:
    """A shadow wider by 0.1 mm moves every edge by 0.05: less is tolerated, more is named with its size."""
    session = simulate_session(
        "screen-1", sound_sessions.brief_protocol(), effects=[parse_effect(f"beam_width={extra_mm}")], seed=5
    )
    report = close_gap(session)
    assert [step.effect for step in report.steps] == named
    assert report.verdict == ("explained" if named else "no_gap")
    for step in report.steps:
        value_mm, (low_mm, high_mm) = step.parameters["extra_mm"]
        assert low_mm < extra_mm < high_mm
        assert high_mm - low_mm < 0.5 * value_mm


def test_a_session_without_data_says_what_it_lacks() -> None:
    session = sound_sessions.recorded()
    poor = close_gap(replace(session, runs=session.runs[:2]))
    assert poor.verdict is None
    assert any("at least 5 are needed" in words for words in poor.missing)


def test_the_noise_is_sized_at_the_fit_of_an_effect_that_has_no_column_too() -> None:
    """A plateau is part of the law: with the noise of the fit without one it would be judged too unlikely."""
    session = sound_sessions.with_plateau()
    first = fit_session(session, gather(session))
    with_plateau = fit_session(session, first.runs, (), True, first)
    pool = compared([first, with_plateau], frozenset(), False)
    linear = next(search.linear for search in pool.searches if search.linear.fit is with_plateau)
    own = normal(linear, likeliest_levels(linear)).base
    assert pool.found["low_speed_plateau",].log_mass > own + np.log(constants.P_EFFECT) - 0.5


def test_an_effect_of_centimetres_is_not_shared_with_an_unnamed_one() -> None:
    """The prior holds sizes of ten and more millimetres: a single effect of them is not less probable than two."""
    effect = parse_effect("clock_drift=-300")
    session = simulate_session("screen-2", sound_sessions.brief_protocol(), effects=[effect], seed=1)
    start = fit_session(session, gather(session))
    fit = fit_session(session, start.runs, [Term("clock_drift")], start=start, law=start.law)
    assert gap_mm(start) > 10.0
    found = compared([start, fit], {"clock_drift"}, unsure_ages=False)
    assert found.probability_of("?session_time:latency") < 0.05
    assert found.probability_of("clock_drift") > 0.99


def test_the_likeliest_noise_does_not_depend_on_where_its_search_begins() -> None:
    """Explanations at different fits are compared: a search that stops early would cost one of them tens of nats."""
    session = sound_sessions.recorded()
    fit = fit_session(session, gather(session))
    seen = linearised(fit, frozenset(), False, fit.use)
    largest = Components(**{name: part.values[-1] for name, part in PARTS.items()})
    starts = (Components(), largest, Components(**dict.fromkeys(PARTS, 0.0) | {"misfit_mm": 0.02, "late_s": 0.003}))
    each = [normal(seen, likeliest_levels(seen, start=start)).base for start in starts]
    assert max(each) - min(each) < 0.5  # nats that a search may leave


def test_a_fit_s_effect_alone_is_judged_at_the_noise_that_is_likely_with_it_alone() -> None:
    """With a member that has the runs' offsets they seem not to scatter: levels of that set would favour it."""
    rng = np.random.default_rng(6)
    n, runs = 600, 40
    run = np.repeat(np.arange(runs), n // runs)
    own = Member("scan_skew", (), rng.standard_normal((n, 1)), np.log(0.02))
    offsets = Member("?run:offset", (), rng.standard_normal((runs, 1))[run], np.log(0.02))
    residual_mm = 2.0 * own.columns[:, 0] + 0.15 * offsets.columns[:, 0] + 0.1 * rng.standard_normal(n)
    seen = linear(rng, residual_mm, (own, offsets), ("scan_skew",))
    seen = replace(seen, parts=replace(seen.parts, run=run, loose_s=np.zeros(runs)))
    levels, search = likely_levels(seen, (), (Components(slow_mm=0.03, run_s=0.0, run_mm=0.0),), most=4)
    alone = next(e for e in search.explanations if search.names(e) == ("scan_skew",))
    value = max(log_evidence(searched(seen, (normal(seen, one),)), alone)[0] for one in levels)
    best = likeliest_levels(seen, alone.members, alone.scales_mm, Components(run_mm=0.1))
    assert best.run_mm > 0.0
    assert value > log_evidence(searched(seen, (normal(seen, best),)), alone)[0] - 1.0


def test_a_run_of_changing_speed_is_no_run_that_lies_off_the_curve() -> None:
    """Its level is open already, as a part of the noise: a misfit of another shape would pass for a level."""
    session = sound_sessions.brief()
    fit = fit_session(session, gather(session))
    members = linearised(fit, frozenset()).members
    levels = {int(one.theta[0]) for one in members if one.name == "?run:latency" and one.theta}
    steady = {k for k, data in enumerate(fit.runs) if data.run.protocol == "circle"}
    assert levels == steady
    assert len(steady) < len(fit.runs) == np.unique(fit.run_index).size
