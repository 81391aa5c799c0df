"""A generated session on which a model with the true effect once seemed less likely than the one without it."""

from draglag.exchange import read_exchange
from draglag.gap.fit import fit_session
from draglag.gap.refits import gained, refit
from draglag.gap.run_data import gather
from draglag.gap.state import Term
from draglag.gap.streams import inspect

from .physics.session import make_session

SEED, CREEP_S_H = 1685657017, -0.0256


def test_a_model_with_the_true_effect_is_the_likelier_one(tmp_path):
    """Sizes of noise are sought one after the other: they must not end elsewhere than without the effect."""
    make_session(tmp_path, SEED, {"thermal_drift": CREEP_S_H})
    _, session = inspect(read_exchange(tmp_path))
    before = fit_session(session, gather(session))
    after = refit(session, before, [Term("clock_drift", ())], plateau=False)
    assert gained(before, after) > 50.0
