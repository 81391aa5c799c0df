"""A generated session on which a model with the true effect once seemed less likely than the one without it."""

from draglag.exchange import read_exchange
from draglag.gap.fitting.joint import fit_session
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.steps import deviance_gained
from draglag.gap.streams.evidence import inspect
from draglag.gap.traces.run_data import gather

from .physics.session import make_session

SEED, CREEP_S_H = 1685657017, -0.0256


def test_a_model_with_the_true_effect_is_the_likelier_one(tmp_path):
    """Sizes of noise are sought one after the other: they must not end elsewhere than without the effect."""
    make_session(tmp_path, SEED, {"thermal_drift": CREEP_S_H})
    _, session = inspect(read_exchange(tmp_path))
    before = fit_session(session, gather(session))
    after = refit(session, before, [Term("clock_drift", ())])
    assert deviance_gained(before, after) > 50.0
