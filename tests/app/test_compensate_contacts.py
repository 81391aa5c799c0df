"""``draglag compensate`` takes the contacts of a table one by one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.compensating import columns, run
from draglag.curve import CurvePoints, fit_form
from draglag.model.file import model_of, save_model

LAG_S = 0.05
T_S = 0.01 * np.arange(60)


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """A screen that is LAG_S late at any speed."""
    speed = np.array([20.0, 50.0, 100.0, 200.0, 400.0])
    curve = fit_form(CurvePoints(speed, np.full(5, LAG_S), np.full(5, 1e-4)), "constant")
    save_model(model_of(curve), tmp_path / "model.json")
    return tmp_path / "model.json"


def test_each_row_gets_the_result_of_its_own_contact(tmp_path: Path, model_file: Path) -> None:
    head = "t_s,x_mm,y_mm"
    first = [f"{t:.2f},{20 + 100 * t:.4f},30" for t in T_S]
    second = [f"{t + 0.004:.3f},200,{150 - 60 * t:.4f}" for t in T_S]
    both = [row for a, b in zip(first, second, strict=True) for row in (f"{a},7", f"{b},8")]
    both.insert(50, "0.2445,90,90,9")  # a brush of one event
    tables = {"first": (head, first), "second": (head, second), "both": (head + ",contact_id", both)}
    out = {}
    for name, (top, rows) in tables.items():
        (tmp_path / f"{name}.csv").write_text("\n".join([top, *rows]) + "\n", "utf-8")
        done = run(model_file, tmp_path / f"{name}.csv", tmp_path / f"{name}.out.csv", "--json")
        assert done.exit_code == 0, done.output
        out[name] = columns(tmp_path / f"{name}.out.csv")
    brush = np.arange(121) == 50
    assert json.loads(done.stdout)["compensated"]["n_retimed"] == 120
    for name, values in out["both"].items():
        np.testing.assert_array_equal(values[~brush][::2], out["first"][name])
        np.testing.assert_array_equal(values[~brush][1::2], out["second"][name])
    assert np.isnan(out["both"]["stylus_t_s"][brush]).all()
    placed = out["both"]["x_stylus_mm"][~brush][::2]
    known = np.isfinite(placed)
    assert known.sum() > 50
    # Written to 1e-4 mm.
    np.testing.assert_allclose(placed[known], (20 + 100 * (T_S + LAG_S))[known], atol=2e-4)


def test_contacts_that_are_all_too_short_are_refused(tmp_path: Path, model_file: Path) -> None:
    rows = "".join(f"{t:.2f},{100 * t:.2f},20,{k // 5}\n" for k, t in enumerate(T_S))
    (tmp_path / "a.csv").write_text("t_s,x_mm,y_mm,contact_id\n" + rows, "utf-8")
    done = run(model_file, tmp_path / "a.csv", tmp_path / "out.csv")
    assert (done.exit_code, done.stdout) == (1, "")
    assert "a.csv: 5 usable touch events are too few" in done.stderr
    assert not (tmp_path / "out.csv").exists()
