"""What the library's modules bring along: nothing heavy that the work at hand does not use."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter, savgol_coeffs, savgol_filter
from scipy.stats import binom

from draglag.instruments.taps import summarise_taps
from draglag.latency.spectrum import _window
from draglag.path.recursion import exponentially_smoothed
from draglag.path.savgol import smoothed, weights
from draglag.recording import Taps

SAMPLE = Path(__file__).parents[1] / "data" / "exchange" / "none-A"
HEAVY = ("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "matplotlib", "pandas", "xarray",
         "joblib", "jinja2", "PySide6", "distributed", "click")  # fmt: skip
ANALYSE = f"""
from draglag.analysis import analyze
from draglag.exchange import read_exchange
assert analyze(read_exchange({str(SAMPLE)!r})).curve is not None
"""


def loaded(code: str, among: tuple[str, ...]) -> set[str]:
    """Those modules that a new process holds after the code."""
    asked = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*(name for name in {among!r} if name in sys.modules))"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return set(asked.stdout.split())


def test_the_package_itself_imports_nothing() -> None:
    assert not loaded("import draglag", (*HEAVY, "numpy", "scipy", "h5py", "pydantic", "importlib.metadata"))


def test_the_analysis_brings_no_files_and_nothing_heavy() -> None:
    assert not loaded("import draglag.analysis", (*HEAVY, "h5py", "pydantic"))


def test_the_gap_is_imported_without_what_only_some_sessions_need() -> None:
    assert not loaded("import draglag.gap", (*HEAVY, "scipy.ndimage", "h5py"))


def test_a_session_is_analysed_without_anything_heavy() -> None:
    assert not loaded(ANALYSE, tuple(name for name in HEAVY if name != "scipy.interpolate"))


def test_the_version_is_looked_up_when_it_is_asked_for() -> None:
    import draglag

    assert draglag.__version__[0].isdigit()
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        _ = draglag.nothing_of_the_kind  # type: ignore[attr-defined]


@pytest.mark.parametrize(("window", "degree"), [(61, 4), (7, 3), (5, 2)])
@pytest.mark.parametrize("order", [0, 1])
def test_local_polynomials_are_those_of_scipy(window: int, degree: int, order: int) -> None:
    values = 300 + np.cumsum(np.random.default_rng(1).normal(size=(200, 2)), axis=0)
    theirs = savgol_filter(values, window, degree, deriv=order, delta=0.008, axis=0)
    np.testing.assert_allclose(
        smoothed(values, window, degree, order, 0.008), theirs, atol=1e-10 * np.abs(theirs).max()
    )
    np.testing.assert_allclose(weights(window, degree), savgol_coeffs(window, degree), atol=1e-12)
    one = savgol_filter(values[:, 0], window, degree, deriv=order, delta=0.008)
    np.testing.assert_allclose(
        smoothed(values[:, 0], window, degree, order, 0.008), one, atol=1e-10 * np.abs(one).max()
    )


@pytest.mark.parametrize("kept", [0.0, 0.9])
def test_exponential_smoothing_is_a_filter_that_begins_at_rest(kept: float) -> None:
    values = 300 + np.cumsum(np.random.default_rng(1).normal(size=200))
    theirs, _ = lfilter([1 - kept], [1, -kept], values, zi=[kept * values[0]])
    np.testing.assert_allclose(exponentially_smoothed(values, kept), theirs, rtol=1e-12)


def test_the_window_of_the_spectrum_is_that_of_scipy() -> None:
    from scipy.signal import get_window

    for m in (7, 64, 121):
        np.testing.assert_allclose(_window(m)[0], get_window("blackmanharris", m), atol=1e-15)


@pytest.mark.parametrize("n", [1, 5, 6, 20, 99, 100])
def test_the_interval_of_a_median_has_the_ranks_of_the_binomial(n: int) -> None:
    latency_s = 1e-3 * np.arange(1.0, n + 1)
    at_s = np.arange(float(n))
    found = summarise_taps(Taps(at_s, at_s + latency_s, np.ones(n, np.int64)))["touch"]
    k = int(binom.ppf(0.025, n, 0.5))
    wanted = latency_s[max(k - 1, 0)], latency_s[min(n - k, n - 1)]
    np.testing.assert_allclose(found.ci95_s, wanted, atol=1e-12)
