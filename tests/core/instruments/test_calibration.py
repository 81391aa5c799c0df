import numpy as np
import pytest

from draglag.errors import DataError, EstimateError
from draglag.instruments.calibration import fit_affine, px_to_mm, target_places
from draglag.recording import Screen

SCREEN = Screen("test", 500.0, 280.0, 1920, 1080)


def touches(places, matrix, noise=0.0, seed=0):
    """Where a panel with this mm → units matrix reports touches of the places."""
    raw = np.column_stack([*places, np.ones(len(places[0]))]) @ np.asarray(matrix).T
    raw += np.random.default_rng(seed).normal(0, noise, raw.shape)
    return raw[:, 0], raw[:, 1]


TURNED = [[0.3, -60.0, 20000.0], [58.0, 0.5, -300.0]]  # by a quarter, mirrored, slightly skewed


@pytest.mark.parametrize("count", [5, 9])
def test_any_affine_panel_is_found_exactly(count):
    places = target_places(500.0, 280.0, count)
    assert len(places[0]) == count
    fit = fit_affine(*touches(places, TURNED), *places)
    x_mm, y_mm = fit(*touches(([123.0], [45.0]), TURNED))
    assert (x_mm[0], y_mm[0]) == pytest.approx((123.0, 45.0))
    assert fit.rms_mm < 1e-9
    assert fit.residual_mm.shape == (count, 2)


def test_residuals_tell_how_well_the_targets_were_touched():
    places = target_places(500.0, 280.0, 9)
    fits = [fit_affine(*touches(places, TURNED, noise=60 * 0.3, seed=k), *places) for k in range(40)]
    # Noise of 0.3 mm an axis; rms is of the distance, corrected for the parameters that were fitted.
    assert np.sqrt(np.mean([f.rms_mm**2 for f in fits])) == pytest.approx(0.3 * np.sqrt(2), rel=0.1)


def test_bad_fits_are_refused_with_the_target_that_is_off():
    places = target_places(500.0, 280.0, 9)
    x, y = touches(places, TURNED)
    x[4] += 60 * 8.0
    with pytest.raises(EstimateError, match="target 5 is off by"):
        fit_affine(x, y, *places)


@pytest.mark.parametrize(("pick", "words"), [(slice(0, 4), "do not determine"), ([0, 1, 2, 0, 1, 2], "along one line")])
def test_too_few_targets_or_targets_in_a_line_are_refused(pick, words):
    places = tuple(axis[pick] for axis in target_places(500.0, 280.0, 9))
    with pytest.raises(EstimateError, match=words):
        fit_affine(*touches(places, TURNED), *places)


def test_columns_that_do_not_match_are_refused():
    with pytest.raises(DataError):
        fit_affine(np.zeros(6), np.zeros(6), np.zeros(5), np.zeros(5))
    with pytest.raises(DataError):
        fit_affine(np.full(6, np.nan), np.zeros(6), np.zeros(6), np.zeros(6))


def test_pixels_become_mm_by_the_screens_size():
    x_mm, y_mm = px_to_mm(SCREEN, np.array([0.0, 1920.0]), np.array([0.0, 540.0]))
    assert x_mm == pytest.approx([0.0, 500.0])
    assert y_mm == pytest.approx([0.0, 140.0])
