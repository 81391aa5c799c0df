"""``draglag compensate``: text contacts, columns and units by ``--map``, and what cannot be right."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import draglag as dl
from app.compensating import columns, run
from draglag.curve import CurvePoints, fit_form
from draglag.model.file import ModelEffect, Provenance, model_of, save_model
from draglag_app.cli import cli

SAMPLE = Path(__file__).parents[1] / "data" / "exchange" / "none-A"
LAG_S = 0.05
HALF_S = 0.01  # of the asymmetry: what is added downwards
T_S = np.arange(0, 2.0, 1 / 120)
X_MM, Y_MM = 250 + 20 * T_S, 20 + 100 * T_S  # down the screen


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """A screen that is LAG_S late at any speed, HALF_S more downwards."""
    speed = np.array([20.0, 50.0, 100.0, 200.0, 400.0])
    curve = fit_form(CurvePoints(speed, np.full(5, LAG_S), np.full(5, 1e-4)), "constant")
    effect = ModelEffect(id="direction_asymmetry", parameters={"difference_s": 2 * HALF_S})
    size = Provenance(screen="screen-1", screen_width_mm=509.2, screen_height_mm=286.4)
    save_model(model_of(curve, size, [effect]), tmp_path / "model.json")
    return tmp_path / "model.json"


def table(path: Path, head: str, *columns: object) -> Path:
    rows = zip(*columns, strict=True)  # type: ignore[call-overload]
    lines = [",".join(str(cell) if isinstance(cell, str) else f"{cell:.7f}" for cell in row) for row in rows]
    path.write_text("\n".join([head, *lines]) + "\n", "utf-8")
    return path


def interleaved(ids: tuple[str, str]) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Two contacts at a time, 120 mm apart, in the same frames."""
    return (
        np.repeat(T_S, 2),
        np.repeat(X_MM, 2) + np.tile([0.0, 120.0], T_S.size),
        np.repeat(Y_MM, 2),
        [*ids] * T_S.size,
    )


def refused(*arguments: object) -> str:
    done = run(*arguments)
    assert (done.exit_code, done.stdout) == (1, ""), done.output
    assert len(done.stderr.splitlines()) == 1
    return done.stderr


def test_column_totals_and_place_hold_an_effect_alike_and_python_agrees(tmp_path: Path, model_file: Path) -> None:
    source = table(tmp_path / "in.csv", "t_s,x_mm,y_mm", T_S, X_MM, Y_MM)
    result = run(model_file, source, tmp_path / "out.csv", "--json")
    assert result.exit_code == 0, result.output
    totals, out = json.loads(result.stdout)["compensated"], columns(tmp_path / "out.csv")
    late_s, middle = LAG_S + HALF_S, slice(20, 200)
    np.testing.assert_allclose(totals["latency_ms_min_median_max"], 1e3 * late_s, atol=0.05)
    np.testing.assert_allclose(out["latency_ms"], 1e3 * late_s, atol=0.05)
    np.testing.assert_allclose((out["y_stylus_mm"] - Y_MM)[middle], 100 * late_s, atol=1e-3)
    np.testing.assert_allclose((out["x_stylus_mm"] - X_MM)[middle], 20 * late_s, atol=1e-3)
    done = dl.compensate(T_S, X_MM, Y_MM, dl.load_model(model_file))
    np.testing.assert_allclose(done.y_stylus_mm, out["y_stylus_mm"], atol=1e-4)
    np.testing.assert_allclose(1e3 * done.latency_s, out["latency_ms"], atol=2e-3)


def test_contacts_named_by_texts_are_taken_one_by_one(tmp_path: Path, model_file: Path) -> None:
    table(tmp_path / "alone.csv", "t_s,x_mm,y_mm", T_S, X_MM, Y_MM)
    table(tmp_path / "both.csv", "t_s,x_mm,y_mm,contact_id", *interleaved(("a", "b")))
    for name in ("alone", "both"):
        result = run(model_file, tmp_path / f"{name}.csv", tmp_path / f"{name}.out.csv")
        assert result.exit_code == 0, result.output
    own, shared = columns(tmp_path / "alone.out.csv"), columns(tmp_path / "both.out.csv")
    for name, values in own.items():
        np.testing.assert_array_equal(shared[name][::2], values)
    moved = np.hypot(shared["x_stylus_mm"] - shared["x_mm"], shared["y_stylus_mm"] - shared["y_mm"])
    assert np.nanmax(moved) < 1.05 * (LAG_S + HALF_S) * np.hypot(20, 100)


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("", "Name the column of the contact, as in --map contact=COLUMN."),
        (",finger", "Name the column of the contact, perhaps --map contact=finger."),
        (",ContactNo", "Name the column of the contact, perhaps --map contact=ContactNo."),
    ],
)
def test_mixed_contacts_are_one_sentence_that_names_a_likely_column(
    tmp_path: Path, model_file: Path, column: str, said: str
) -> None:
    *numbers, ids = interleaved(("a", "b"))
    source = table(tmp_path / "in.csv", "t_s,x_mm,y_mm" + column, *numbers, *([ids] if column else []))
    line = refused(model_file, source, tmp_path / "out.csv")
    assert "several contacts are mixed" in line
    assert said in line
    assert not (tmp_path / "out.csv").exists()
    if column:
        assert run(model_file, source, tmp_path / "out.csv", "--map", f"contact={column[1:]}").exit_code == 0


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_times_in_another_unit_are_refused_and_read_by_map(tmp_path: Path, model_file: Path, factor: float) -> None:
    source = table(tmp_path / "in.csv", "t_s,x_mm,y_mm", factor * T_S, X_MM, Y_MM)
    line = refused(model_file, source, tmp_path / "out.csv")
    assert "in.csv: t_s: the events of a run come one every" in line
    assert "as in --map t=t_s:ms" in line
    unit = {1e3: "ms", 1e6: "us"}[factor]
    assert run(model_file, source, tmp_path / "out.csv", "--map", f"t=t_s:{unit}").exit_code == 0
    np.testing.assert_allclose(columns(tmp_path / "out.csv")["latency_ms"], 1e3 * (LAG_S + HALF_S), atol=0.05)


def test_positions_in_metres_are_refused_and_in_pixels_a_warning(tmp_path: Path, model_file: Path) -> None:
    metres = table(tmp_path / "m.csv", "t_s,x_mm,y_mm", T_S, 1e-3 * X_MM, 1e-3 * Y_MM)
    line = refused(model_file, metres, tmp_path / "out.csv")
    assert "nearer to the corner of the screen than any stylus stays" in line
    assert "as in --map x=COLUMN:m --map y=COLUMN:m" in line
    pixels = table(tmp_path / "px.csv", "t_s,x_mm,y_mm", T_S, 3.77 * X_MM, 3.77 * Y_MM)
    done = run(model_file, pixels, tmp_path / "out.csv", "--json")
    assert done.exit_code == 0
    assert "warning: The touches of px.csv reach from 942.5" in done.stderr
    assert "stated to be 509.2" in json.loads(done.stdout)["compensated"]["warnings"][0]


def test_columns_and_units_are_named_as_for_an_import(tmp_path: Path, model_file: Path) -> None:
    plain = table(tmp_path / "plain.csv", "t_s,x_mm,y_mm", T_S + 3.0, X_MM, Y_MM)
    per_px = 509.2 / 1920, 286.4 / 1080
    other = table(
        tmp_path / "other.csv", "note,posY,stamp,posX", ["x"] * T_S.size, Y_MM / per_px[1], 1e3 * T_S, X_MM / per_px[0]
    )
    assert run(model_file, plain, tmp_path / "plain.out.csv").exit_code == 0
    names = ("--map", "t=stamp:ms", "--map", "x=posX:px", "--map", "y=posY:px", "--map", "clock=3.0")
    assert "x is in pixels. Give --screen." in refused(model_file, other, tmp_path / "out.csv", *names)
    done = run(model_file, other, tmp_path / "other.out.csv", *names, "--screen", "screen-1")
    assert done.exit_code == 0, done.output
    expected, found = columns(tmp_path / "plain.out.csv"), columns(tmp_path / "other.out.csv")
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, atol=0.011)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--map", "t=stamp:h"), "--map t=stamp:h: “h” is no unit of t. Use one of s, ms, us, ns."),
        (("--map", "laser.t=a"), "--map laser.t=…: compensation does not use it. Keys are t, x, y, contact, clock."),
        (("--map", "x=there"), "in.csv: no column there in its first line."),
        (("--map", "contact=there"), "in.csv: no column there in its first line. Its columns are t_s,x_mm,y_mm."),
    ],
)
def test_a_map_that_cannot_be_followed_is_one_sentence(
    tmp_path: Path, model_file: Path, arguments: tuple[str, ...], said: str
) -> None:
    source = table(tmp_path / "in.csv", "t_s,x_mm,y_mm", T_S, X_MM, Y_MM)
    assert said in refused(model_file, source, tmp_path / "out.csv", *arguments)


def test_a_map_without_a_table_is_a_wrong_command_line(tmp_path: Path, model_file: Path) -> None:
    done = run(model_file, "--tracking", "--map", "t=stamp")
    assert done.exit_code == 2
    assert "--map, --screen and --units-per-mm are of IN.csv: give it, and OUT.csv." in done.stderr


def test_a_saved_curve_knows_the_size_of_its_screen(tmp_path: Path) -> None:
    session = dl.read(SAMPLE)
    done = CliRunner().invoke(cli, ["analyze", str(SAMPLE), "--save-model", str(tmp_path / "model.json")])
    assert done.exit_code == 0, done.output
    of = dl.load_model(tmp_path / "model.json").provenance
    assert (of.screen_width_mm, of.screen_height_mm) == (session.screen.width_mm, session.screen.height_mm)


def test_help_says_why_last_events_have_no_place() -> None:
    said = " ".join(run("--help").stdout.split())
    assert "The last events of each contact, about one latency, have no place of the stylus (nan)" in said
    assert "events that would show it were not recorded, as the contact had ended" in said
