"""A latency that wanders in the course of a run is no second filter that comes and goes."""

from __future__ import annotations

import numpy as np

from draglag.gap import close_gap
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray
from draglag.simulation import simulate_session
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.effects.second_filter_mode.switching import log_likelihood_of_levels
from draglag.simulation.effects.second_filter_mode.wandering import Course, log_likelihood_of_wandering
from draglag.simulation.kinematics import Kinematics

SIZE_S, ERROR_S = 0.006, 0.0005


class Breathing(FittedShape):
    """Later and earlier in turn, as a fan's control loop may make a controller."""

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + SIZE_S * np.sin(2 * np.pi * k.session_s / 23.0)


def courses_of(seed: int, scatter: float = 1.0, apart_s: float = SIZE_S) -> tuple[list[Course], list[Course]]:
    """Six runs with an edge each half second: on two lasting levels, and of a walk."""
    rng = np.random.default_rng(seed)
    levels, walks = [], []
    for _ in range(6):
        t_s = np.cumsum(rng.uniform(0.3, 0.7, 80))
        sd_s = np.full(t_s.size, ERROR_S)
        noise_s = scatter * ERROR_S * rng.standard_normal(t_s.size)
        on = np.searchsorted(np.cumsum(rng.exponential(8.0, 40)), t_s) % 2
        course_s = np.interp(t_s, np.arange(0.0, 60.0, 3.0), SIZE_S / 2 * rng.standard_normal(20))
        levels.append((t_s, apart_s * on + noise_s, sd_s))
        walks.append((t_s, course_s + noise_s, sd_s))
    return levels, walks


def nats(courses: list[Course]) -> float:
    """By which two levels are likelier than a walk."""
    return log_likelihood_of_levels(courses) - log_likelihood_of_wandering(courses)


def test_two_levels_are_no_walk_and_a_walk_is_no_two_levels() -> None:
    for seed, scatter in ((1, 1.0), (2, 1.0), (3, 2.0), (4, 2.0)):
        levels, walks = courses_of(seed, scatter)
        assert nats(levels) > 10
        assert nats(walks) < -10


def test_levels_with_more_scatter_of_edges_than_is_known_are_levels() -> None:
    """Half of the edges later by 3 ms and half earlier, in turn, as ways up and down may be: six times their error."""
    levels, _ = courses_of(6, apart_s=2 * SIZE_S)
    turn = [(t_s, late_s + 0.003 * (-1.0) ** np.arange(t_s.size), sd_s) for t_s, late_s, sd_s in levels]
    assert nats(turn) > 10


def test_one_wild_edge_decides_nothing() -> None:
    levels, walks = courses_of(5)
    for courses in (levels, walks):
        courses[0][1][40] += 0.05
    assert nats(levels) > 10
    assert nats(walks) < -10


def test_a_latency_that_wanders_has_no_name() -> None:
    session = simulate_session("screen-1", load_protocol("demo"), effects=[Breathing(SIZE_S)], seed=5)
    report = close_gap(session)
    assert (report.verdict, report.steps) == ("unexplained", ())
