"""``import draglag as dl``: its names, its examples, and what its results look like."""

from __future__ import annotations

import doctest
import html
import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import draglag as dl
from draglag.analysis.tables import RUN_COLUMNS
from draglag.recording import empty_laser, empty_touch
from draglag.shown import brief, table_html

SAMPLE = Path(__file__).parents[1] / "data" / "exchange" / "none-A"
FUNCTIONS = [name for name in dl.__all__ if isinstance(getattr(dl, name), FunctionType)]


@pytest.fixture(scope="module")
def session() -> dl.Session:
    return dl.read(SAMPLE)


@pytest.fixture(scope="module")
def analysis(session: dl.Session) -> dl.Analysis:
    return dl.analyze(session)


@pytest.fixture(scope="module")
def folder(session: dl.Session, analysis: dl.Analysis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the examples find where they are run: a session file and a model."""
    made = tmp_path_factory.mktemp("examples")
    dl.write(session, made / "session.h5")
    assert analysis.curve is not None
    dl.save_model(dl.model_of(analysis.curve), made / "model.json")
    return made


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_has_an_example_that_runs(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    matplotlib.use("agg")
    function = getattr(dl, name)
    home = importlib.import_module(function.__module__)
    (test,) = doctest.DocTestFinder(recurse=False).find(function, name, module=home)
    assert test.examples, f"{name} has no example"
    said: list[str] = []
    failed = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=said.append).failed
    assert not failed, "".join(said)


def test_all_names_are_there_and_only_those_are_promised() -> None:
    assert sorted(dl.__all__) == list(dl.__all__)
    assert set(dl.__all__) <= set(dir(dl))
    assert all(getattr(dl, name) is not None for name in dl.__all__)


def test_a_name_imports_what_it_needs_and_no_more() -> None:
    code = (
        "import sys, draglag as dl; dl.DataError; print('numpy' in sys.modules); dl.read; print('numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_reprs_are_short_and_say_what_there_is(session: dl.Session, analysis: dl.Analysis) -> None:
    run = session.runs[0]
    records = (session, run, run.touch, run.laser, analysis, analysis.runs[0], analysis.curve, analysis.taps["touch"])
    for shown in (*records, analysis.validation[0], dl.compare(analysis, analysis)):
        assert len(repr(shown)) < 600, type(shown)
        assert type(shown).__name__ in repr(shown)
    assert "runs=<15>" in repr(session)
    assert f"t_s=<{run.touch.t_s.size}>" in repr(run.touch)
    assert "13 of 13 runs with a latency" in repr(analysis)
    assert "double_exponential" in repr(analysis.curve)
    assert brief(empty_touch()) == "TouchTrace(dropped=0)"
    assert "x" not in brief(empty_laser())


def test_notebooks_get_tables_in_which_nothing_is_markup(session: dl.Session, analysis: dl.Analysis) -> None:
    from dataclasses import replace

    evil = "<script>alert(1)</script>"
    difference = dl.compare(analysis, analysis)
    assert difference._repr_html_().count("<tr>") == difference.speed_mm_s.size + 1
    assert "95 % band, p = 1" in difference._repr_html_()
    for shown in (replace(session, name=evil), replace(analysis, session=evil), dl.GapReport(evil, None)):
        page = shown._repr_html_()
        assert "<table>" in page
        assert evil not in page
        assert html.escape(evil) in page
    assert analysis._repr_html_().count("<tr>") > len(analysis.runs)
    model = dl.model_of(analysis.curve, effects=[("clock_drift", {"drift_ppm": 12.5})])
    assert repr(model) == f"LatencyModel({analysis.curve.form.replace('_', ' ')}, clock_drift, {_range(analysis)} mm/s)"
    assert "<td>drift_ppm</td><td>12.5</td>" in model._repr_html_()
    run = analysis.runs[0]
    assert f"<td>{run.latency_ms:.4g}</td>" in run._repr_html_()
    log = session.runs[0].touch
    page = dl.compensate(log.t_s, log.x_mm, log.y_mm, model)._repr_html_()
    assert f"<td>n_events</td><td>{log.t_s.size}</td>" in page
    assert "clock" in page  # the note on what is left


def _range(analysis: dl.Analysis) -> str:
    assert analysis.curve is not None
    low, high = analysis.curve.speed_range_mm_s
    return f"{low:.0f} to {high:.0f}"


def test_a_gap_s_table_has_sizes_and_intervals_or_what_is_left(session: dl.Session) -> None:
    from dataclasses import replace

    report = dl.find_gap(session)
    if report.steps:  # of the sample session
        report = replace(report, steps=(), verdict="no_gap")
    page = report._repr_html_()
    assert "no gap" in page
    assert f"<td>{report.gap_last_mm:.4g}</td><td>{report.noise_floor_mm:.4g}</td>" in page
    drift = dl.find_gap(dl.simulate("screen-1", "demo", effects={"clock_drift": 40.0}, seed=3))
    (step,) = drift.steps
    value, (low, high) = step.parameters["drift_ppm"]
    assert f"<td>drift_ppm</td><td>{value:.4g}</td><td>{low:.4g}</td><td>{high:.4g}</td>" in drift._repr_html_()
    assert table_html("t", ["a"], [[None], [float("nan")], [1.23456]]).count("–") == 2


def test_frames_hold_what_the_analysis_holds(analysis: dl.Analysis) -> None:
    frame = analysis.to_dataframe()
    assert list(frame.columns) == list(RUN_COLUMNS)
    np.testing.assert_allclose(frame["latency_ms"], [run.latency_ms for run in analysis.runs])
    assert frame["latency_low_ms"].lt(frame["latency_ms"]).all()
    data = analysis.to_xarray()
    assert data["latency_ms"].attrs["units"] == "ms"
    assert data["curve_ms"].dims == ("speed_mm_s",)
    assert float(data["latency_ms"].sel(run="run-01")) == pytest.approx(analysis.runs[0].latency_ms)
    assert analysis.curve is not None
    at = float(data["speed_mm_s"][10])
    assert float(data["curve_ms"][10]) == pytest.approx(1e3 * float(analysis.curve.predict_s(np.array(at))))


def test_a_run_without_a_latency_is_a_gap_in_the_frame(session: dl.Session) -> None:
    from dataclasses import replace

    broken = replace(session.runs[0], touch=empty_touch())
    frame = dl.analyze(replace(session, runs=(broken, *session.runs[1:]))).to_dataframe()
    assert np.isnan(frame["latency_ms"][0])
    assert frame["latency_ms"].dtype == float
    assert "no_touch" in frame["flags"][0]


def test_figures_are_drawn_on_the_axes_given(analysis: dl.Analysis) -> None:
    axes = Figure().add_subplot()
    assert analysis.plot(ax=axes) is axes
    assert analysis.curve is not None
    assert analysis.curve.plot(axes) is axes
    assert dl.compare(analysis, analysis).plot(Figure().add_subplot()).get_ylabel().endswith("ms")


@pytest.mark.parametrize(("package", "use", "extra"), [
    ("pandas", lambda a: a.to_dataframe(), "frames"),
    ("xarray", lambda a: a.to_xarray(), "frames"),
    ("matplotlib", lambda a: a.plot(), "report"),
])  # fmt: skip
def test_without_its_package_a_method_says_what_to_type(
    analysis: dl.Analysis, monkeypatch: pytest.MonkeyPatch, package: str, use: object, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(dl.DraglagError, match=rf'pip install "draglag\[{extra}\]"'):
        use(analysis)  # type: ignore[operator]


def test_what_cannot_be_is_one_sentence(session: dl.Session, tmp_path: Path) -> None:
    with pytest.raises(dl.DataError, match="differ in number"):
        dl.fit_curve([1, 2, 3], [0.1, 0.2])
    with pytest.raises(dl.EstimateError, match="unknown curve form"):
        dl.fit_curve([1, 2, 3], [0.1, 0.2, 0.3], form="parabola")
    with pytest.raises(dl.EstimateError, match="unknown estimator"):
        dl.analyze(session, estimator="guess")
    with pytest.raises(dl.DataError, match="unknown format"):
        dl.export(session, tmp_path / "x", to="xlsx")  # type: ignore[arg-type]
    with pytest.raises(dl.DataError):
        dl.find_gap(session, without=["no_such_effect"])
    with pytest.raises(dl.DataError):
        dl.read(tmp_path / "nothing.h5")


def test_the_page_on_python_runs(folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "session.h5").write_bytes((folder / "session.h5").read_bytes())
    page = (Path(__file__).parents[2] / "docs" / "python.md").read_text("utf-8")
    snippets = re.findall(r"```python\n(.*?)```", page, re.S)
    names: dict[str, object] = {}
    for snippet in snippets:
        exec(snippet, names)
    assert (tmp_path / "latency.png").stat().st_size > 1000
    assert len(names["frame"]) == 13  # type: ignore[arg-type]
    assert set(re.findall(r"dl\.([a-z]\w+)\(", page)) <= set(dl.__all__)
