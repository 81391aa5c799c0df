"""The command line: good input does its work, bad input gets one sentence and exit 1, and nothing is overwritten."""

from __future__ import annotations

import gzip
import json
import math
import shutil
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from draglag.curve import CurvePoints, fit_form
from draglag.exchange import read_exchange
from draglag.model.file import model_of, save_model
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS, parse_effect
from draglag.store import SessionWriter, read_analyses, read_session, verify, write_session
from draglag_app.cli import cli
from draglag_app.cli.main import COMMANDS, load

SAMPLES = Path(__file__).parent.parent / "data" / "exchange"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


def one_line(result: Result) -> str:
    """The one sentence of a failure: exit 1, nothing on stdout, no traceback."""
    assert result.exit_code == 1, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("draglag: ")
    return lines[0]


@pytest.fixture(scope="module")
def session_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cli") / "session.h5"
    assert run("import", SAMPLES / "none-A", "--out", path).exit_code == 0
    return path


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """A constant latency of 50 ms."""
    points = CurvePoints(np.array([50.0, 100, 200]), np.full(3, 0.05), np.full(3, 1e-3))
    path = tmp_path / "model.json"
    save_model(model_of(fit_form(points, "constant")), path)
    return path


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself_with_an_example(name: str) -> None:
    result = run(name, "--help")
    assert result.exit_code == 0
    assert f"draglag {name}" in result.stdout.split("Example")[1]
    assert load(COMMANDS[name][0]).name == name


def test_the_list_of_commands_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom draglag_app.cli import cli\n"
        "cli.main(['--help'], standalone_mode=False)\n"
        "print(sorted({'numpy', 'scipy', 'h5py', 'matplotlib', 'PySide6', 'pydantic'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[-1] == "[]"


def test_no_command_of_the_lists_draws_a_window_when_imported() -> None:
    code = (
        "import sys, draglag_app.cli.analyze, draglag_app.cli.files, draglag_app.cli.verify, draglag_app.cli.simulate\n"
    )
    code += "print('PySide6' in sys.modules, 'matplotlib' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "False False"


def test_import_makes_a_sound_file(session_file: Path) -> None:
    assert verify(session_file) == []
    assert len(read_session(session_file).runs) == 15


def test_import_names_what_it_left_out(tmp_path: Path) -> None:
    shutil.copytree(SAMPLES / "none-A", tmp_path / "in")
    (tmp_path / "in" / "run-03.laser.csv.gz").unlink()
    result = run("import", tmp_path / "in", "--out", tmp_path / "s.h5")
    assert result.exit_code == 0
    assert "warning: run-03: there is no laser file" in result.stderr


def test_a_malformed_line_is_named_with_its_file(tmp_path: Path) -> None:
    shutil.copytree(SAMPLES / "none-A", tmp_path / "in")
    (tmp_path / "in" / "run-01.touch.csv.gz").unlink()
    (tmp_path / "in" / "run-01.touch.csv").write_text("t_s,x_mm,y_mm\n1,2,3\n2,oops,3\n")
    line = one_line(run("import", tmp_path / "in", "--out", tmp_path / "s.h5"))
    assert "run-01.touch.csv, line 3" in line
    assert "expected a number for x_mm" in line
    assert not (tmp_path / "s.h5").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("import", SAMPLES / "none-A", "--out", "{taken}"),
        ("export", "{session}", "--to", "csv", "--out", "{taken}"),
        ("export", "{session}", "--to", "exchange", "--out", "{taken}"),
        ("export", "{session}", "--to", "mat", "--out", "{taken}"),
        ("simulate", "--screen", "screen-1", "--out", "{taken}"),
    ],
)
def test_what_exists_is_not_overwritten(tmp_path: Path, session_file: Path, arguments: tuple[object, ...]) -> None:
    taken = tmp_path / "taken"
    taken.write_text("precious")
    line = one_line(run(*(str(a).format(taken=taken, session=session_file) for a in arguments)))
    assert "not overwritten" in line
    assert taken.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [taken]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("analyze", "none.h5"), "no such file"),
        (("analyze", __file__), "not an HDF5 file"),
        (("import", "none", "--out", "s.h5"), "no such folder or file"),
        (("import", Path(__file__).parent, "--out", "s.h5"), "holds no session.json"),
        (("analyze", Path(__file__).parent), "holds no session. Name a session file (.h5), or a folder that holds ses"),
        (("export", "none.h5", "--to", "csv", "--out", "x"), "no such file"),
        (("simulate", "--screen", "no-screen", "--out", "s.h5"), "no-screen"),
        (("simulate", "--screen", "screen-1", "--effect", "gremlins=1", "--out", "s.h5"), "gremlins"),
        (("simulate", "--screen", "screen-1", "--protocol", "nothing", "--out", "s.h5"), "nothing"),
        (("import", SAMPLES / "none-A", "--out", "no/such/s.h5"), "no such folder"),
        (("analyze", SAMPLES / "none-A", "--save"), "only a session file can keep a result"),
        (("reproduce", "--out", __file__), "cannot be made (File exists)"),
    ],
)
def test_bad_input_gets_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in one_line(run(*arguments))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("nothing",),
        ("analyze",),
        ("export", "s.h5", "--to", "word", "--out", "x"),
        ("analyze", "s", "--x"),
        ("analyze", "s", "--update-rate", "nan"),
        ("analyze", "s", "--window-ms", "0", "nan"),
        ("check", "--touch", "sim:", "--seconds", "nan"),
        ("record", "demo", "--touch", "sim:", "--stylus-mm", "inf", "--out", "x"),
    ],
)
def test_wrong_usage_is_exit_2(arguments: tuple[str, ...]) -> None:
    assert run(*arguments).exit_code == 2


MOVES = "".join(f"{0.01 * k:.2f},{k},20\n" for k in range(40))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t_s,x_mm,y_mm\n", "holds no events"),
        ("t_s,x_mm,y_mm\n" + MOVES + "0.4,40\n", "line 42: expected 3 cells"),
        ("t_s,x_mm,y_mm\n" + MOVES.replace("0.05,", "0.05,7,"), "line 7: expected 3 cells"),
        ("t_s,x_mm,y_mm\n" + MOVES.replace("0.05,", "1e300,"), "cannot be seconds"),
        ("t_s,x_mm,y_mm\n0,1,2\n", "touch.csv: 1 usable touch events are too few"),
        ("x,y\n1,2\n", "touch.csv: no column t_s"),
    ],
)
def test_events_that_cannot_be_compensated_are_one_sentence(
    tmp_path: Path, model_file: Path, text: str, message: str
) -> None:
    (tmp_path / "touch.csv").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        line = one_line(run("compensate", model_file, tmp_path / "touch.csv", tmp_path / "out.csv"))
    assert message in line
    assert not (tmp_path / "out.csv").exists()


def test_events_with_a_quoted_head_and_gzipped_are_compensated(tmp_path: Path, model_file: Path) -> None:
    with gzip.open(tmp_path / "touch.csv.gz", "wt") as file:
        file.write('"t_s","x_mm","y_mm"\n' + MOVES)
    result = run("compensate", model_file, tmp_path / "touch.csv.gz", tmp_path / "out.csv", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["compensated"]["n_retimed"] == 40
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 41


def test_a_bug_is_one_line_and_a_saved_traceback(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(path: Path) -> None:
        raise ZeroDivisionError("secret detail")

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr("draglag.store.read_with_state", broken)
    line = one_line(run("analyze", "s.h5"))
    assert "unexpected ZeroDivisionError" in line
    log = Path(line.split("file ")[-1].rstrip("."))
    assert "secret detail" in log.read_text()
    assert tmp_path in log.parents


@pytest.mark.parametrize("command", [("analyze", "--report"), ("gap", "--report")])
def test_without_matplotlib_drawings_are_one_sentence(
    tmp_path: Path, session_file: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    name, *options = command
    result = run(name, session_file, *options, tmp_path / "drawn")
    assert result.exit_code == 1
    last = result.stderr.splitlines()[-1]
    package, line = "the Python package matplotlib (extra report)", 'pip install "draglag[report]"'
    assert last == f"draglag: {package} is not installed; run: {line}."
    assert not (tmp_path / "drawn").exists()


def test_analyze_prints_one_json_object_of_the_agreed_shape(session_file: Path) -> None:
    result = run("analyze", session_file, "--json")
    assert (result.exit_code, result.stderr) == (0, "")
    data = json.loads(result.stdout)
    assert {"session", "runs", "curve", "taps", "validation"} <= set(data)
    keys = {"id", "protocol", "nominal_speed_mm_s", "speed_mm_s", "latency_ms", "latency_ci95_ms", "stamps", "n_edges"}
    keys |= {"n_rejected", "J0_per_edge_mm2", "J_per_edge_mm2", "stylus_diameter_mm", "flags"}
    assert all(keys <= set(row) for row in data["runs"])
    assert {"form", "parameters", "rms_ms", "speed_range_mm_s", "rivals"} <= set(data["curve"])
    assert data["taps"]["touch"]["n"] == data["taps"]["release"]["n"] == 100
    assert {row["protocol"] for row in data["validation"]} == {"chirp", "step"}
    truth = json.loads((SAMPLES / "labels.json").read_text())["none-A"]["runs"]
    errors = [row["latency_ms"] - truth[row["id"]]["true_latency_ms"] for row in data["runs"]]
    # What a plain reading of Eq. 1–2 reaches on these data.
    assert len(errors) == 13
    assert max(map(abs, errors)) < 4.0
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) < 1.3


def test_gap_takes_another_diameter_of_the_stylus() -> None:
    """Of a sound session with a wrong one, the shadow is narrower or wider than the stylus by the difference."""
    recorded_mm = json.loads((SAMPLES / "none-A" / "session.json").read_text("utf-8"))["stylus_diameter_mm"]
    result = run("gap", SAMPLES / "none-A", "--stylus-mm", recorded_mm + 1, "--json")
    (step,) = json.loads(result.stdout)["steps"]
    assert step["effect"] in ("beam_width", "scale_error")
    assert json.loads(run("gap", SAMPLES / "none-A", "--stylus-mm", recorded_mm, "--json").stdout)["steps"] == []


def test_analyze_takes_another_diameter_of_the_stylus_and_says_so_in_the_report(tmp_path: Path) -> None:
    result = run("analyze", SAMPLES / "none-A", "--stylus-mm", 9, "--report", tmp_path, "--json")
    found = json.loads(result.stdout)
    assert found["verification"]["stylus_width"]["known_mm"] == 9
    assert any("by ruler 9 mm" in text for text in found["warnings"])
    assert "9.00 mm, corrected: recorded as 7.00 mm" in (tmp_path / "report.html").read_text("utf-8")


def test_a_run_that_cannot_be_estimated_is_null_in_the_json_and_named_for_people(tmp_path: Path) -> None:
    shutil.copytree(SAMPLES / "none-A", tmp_path / "in")
    (tmp_path / "in" / "run-03.laser.csv.gz").unlink()
    result = run("analyze", tmp_path / "in", "--json")
    (row,) = [row for row in json.loads(result.stdout)["runs"] if row["id"] == "run-03"]
    assert row["latency_ms"] is None
    assert row["flags"]
    assert "NaN" not in result.stdout
    assert "run-03: no latency" in run("analyze", tmp_path / "in").stdout


def test_a_session_without_any_latency_is_one_sentence_and_exit_1(tmp_path: Path) -> None:
    shutil.copytree(SAMPLES / "none-A", tmp_path / "in")
    for file in (tmp_path / "in").glob("run-*.laser.csv.gz"):
        file.unlink()
    result = run("analyze", tmp_path / "in", "--json")
    assert result.exit_code == 1
    assert all(row["latency_ms"] is None for row in json.loads(result.stdout)["runs"])
    (sentence,) = [line for line in result.stderr.splitlines() if line.startswith("draglag: ")]
    assert "none of 13 runs gave a latency (no edges" in sentence


def test_results_are_kept_as_printed_unless_asked_not_to(tmp_path: Path, session_file: Path) -> None:
    path = tmp_path / "s.h5"
    shutil.copy(session_file, path)
    before, kept = path.read_bytes(), len(read_analyses(path))
    assert run("analyze", path, "--no-save").exit_code == 0
    assert path.read_bytes() == before
    result = run("analyze", path, "--estimator", "paper", "--update-rate", 100, "--json")
    *_, stored = read_analyses(path)
    assert len(read_analyses(path)) == kept + 1
    assert stored.result == json.loads(result.stdout)
    assert (stored.options["estimator"], stored.options["update_rate_hz"]) == ("paper", 100.0)
    assert stored.created_utc
    assert verify(path) == []


def test_a_session_leaves_and_comes_back(tmp_path: Path, session_file: Path) -> None:
    assert run("export", session_file, "--to", "exchange", "--out", tmp_path / "out").exit_code == 0
    assert run("import", tmp_path / "out", "--out", tmp_path / "back.h5").exit_code == 0
    one, two = read_session(session_file), read_exchange(tmp_path / "out")
    assert [r.touch.x_mm.tolist() for r in one.runs] == [r.touch.x_mm.tolist() for r in two.runs]
    assert verify(tmp_path / "back.h5") == []


@pytest.mark.parametrize(("kind", "name"), [("csv", "tables"), ("mat", "s.mat"), ("netcdf", "s.nc")])
def test_export_to_other_programs(tmp_path: Path, session_file: Path, kind: str, name: str) -> None:
    if kind == "netcdf":
        pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    result = run("export", session_file, "--to", kind, "--out", tmp_path / name)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / name).exists()


def test_verify_says_what_is_wrong_and_exits_1(tmp_path: Path, session_file: Path) -> None:
    assert run("verify", session_file).stdout == f"{session_file}: sound\n"
    path = tmp_path / "s.h5"
    path.write_bytes(session_file.read_bytes()[:100_000])
    result = run("verify", path)
    assert result.exit_code == 1
    assert result.stderr.startswith(f"error: {path}: is truncated")
    in_json = run("verify", path, "--json")
    data = json.loads(in_json.stdout)
    assert in_json.stderr == result.stderr
    assert data["ok"] is False
    assert data["findings"][0]["level"] == "error"


def test_verify_saves_an_unfinished_recording(tmp_path: Path, session_file: Path) -> None:
    session = read_session(session_file)
    writer = SessionWriter(tmp_path / "s.h5", session)
    writer.abandon()
    result = run("verify", tmp_path / "s.h5.partial")
    assert result.exit_code == 0, result.output
    assert "saved from s.h5.partial" in result.stdout
    assert len(read_session(tmp_path / "s.h5").runs) == 15


def test_simulate_is_repeatable_and_effects_reach_the_data(tmp_path: Path) -> None:
    protocol = tmp_path / "short.toml"
    protocol.write_text('name = "short"\n[[runs]]\nkind = "circle"\nspeed_mm_s = 300\nduration_s = 3\n')
    common = ("simulate", "--screen", "screen-1", "--protocol", protocol, "--seed", 5)
    for name, extra in (("a", ()), ("b", ()), ("c", ("--effect", "clock_offset=0.01"))):
        result = run(*common, *extra, "--out", tmp_path / f"{name}.h5")
        assert result.exit_code == 0, result.output
    one, same, other = (read_session(tmp_path / f"{name}.h5").runs[0].laser.t_s.tolist() for name in "abc")
    assert one == same
    assert one != other


def test_a_full_disk_behind_the_output_is_one_sentence(tmp_path: Path) -> None:
    """Not a bug to report: what stdout goes to is full."""
    short = tmp_path / "short.toml"
    short.write_text('name = "short"\n[[runs]]\nkind = "circle"\nspeeds_mm_s = [240]\nduration_s = 10.0\n')
    command = [sys.executable, "-c", "from draglag_app.cli import main; main()", "plan", short, "--screen", "screen-1"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("draglag: the output cannot be written (No space left on device). Make room")
    assert "Traceback" not in done.stderr


def test_help_of_simulate_lists_every_effect_with_a_size_that_it_takes() -> None:
    reported = CliRunner().invoke(cli, ["simulate", "--help"]).output
    for name, effect in EFFECTS.items():
        assert f"  {name} " in reported
        assert parse_effect(f"{name}={effect.parameters[0].typical:g}").id == name
    assert "pitch_mm 5 mm" in reported


def test_validation_on_smoothed_edges_and_without_runs_that_went_wrong(tmp_path: Path) -> None:
    """A smoothed path follows the stylus more closely than interpolated events: it leaves less misalignment."""
    made = simulate_session("screen-1", load_protocol("demo"), seed=3)
    varying = [run for run in made.runs if run.protocol != "circle"]
    failed = replace(varying[0], id="run-99", outcome="aborted")
    write_session(replace(made, runs=(*made.runs, failed)), tmp_path / "s.h5")
    runner, model = CliRunner(), str(tmp_path / "m.json")
    assert runner.invoke(cli, ["analyze", str(tmp_path / "s.h5"), "--save-model", model]).exit_code == 0

    def said(*options: str) -> dict[str, Any]:
        ran = runner.invoke(cli, ["validate", str(tmp_path / "s.h5"), "--model", model, "--json", *options])
        assert ran.exit_code == 0, ran.output
        return json.loads(ran.stdout)

    raw, smoothed = said("--raw"), said("--smoothed")
    assert said()["validation"] == raw["validation"]
    assert raw["excluded"] == {"run-99": "aborted"}
    assert [item["run"] for item in raw["validation"]] == [run.id for run in varying]
    left = [found["validation"][0]["J_per_edge_mm2"] for found in (raw, smoothed)]
    assert left[1] < left[0]
