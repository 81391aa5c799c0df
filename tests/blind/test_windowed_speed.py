"""Screens whose latency follows the speed of a window, as trackers measure it."""

from draglag.exchange import read_exchange
from draglag.gap import close_gap

from .conditions import profile_for
from .physics.session import make_session

SEED = 775770472


def test_a_steep_law_of_a_windowed_speed_is_no_gap(tmp_path):
    """On small fast circles the window flattens most of a hand's changes of speed: taken for those of the moment, they
    make each shadow too short or too long, by up to 0.3 mm in the mean of a run."""
    make_session(tmp_path, SEED, {}, profile_for({}, "realistic", "power"))
    report = close_gap(read_exchange(tmp_path))
    assert (report.verdict, report.steps) == ("no_gap", ())
