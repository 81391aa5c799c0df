"""A generated session in which the search with the curve's own form ends without it."""

from draglag.exchange import read_exchange
from draglag.gap import close_gap

from .conditions import profile_for
from .physics.session import make_session

SEED, SPEED_MM_S = 1104824195, 112.92415169633702


def test_a_plateau_that_only_the_fit_with_the_curves_own_form_shows_is_named(tmp_path):
    """On a speed-adaptive law, columns at the first fit promise nothing of it: the second search begins with it."""
    effects = {"low_speed_plateau": SPEED_MM_S}
    make_session(tmp_path, SEED, effects, profile_for(effects, "realistic", "adaptive"))
    report = close_gap(read_exchange(tmp_path))
    assert (report.verdict, [step.effect for step in report.steps]) == ("explained", ["low_speed_plateau"])
    _, (low, high) = report.steps[0].parameters["speed_mm_s"]
    assert low - (high - low) / 2 < SPEED_MM_S < high + (high - low) / 2  # missed one time in 10 000
