"""Many sessions at once: the same figures as one by one, on cores and on a cluster; what fails is listed."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from itertools import chain, combinations, islice
from pathlib import Path
from xml.etree import ElementTree

import pandas
import pytest
from click.testing import CliRunner, Result

import draglag as dl
from draglag_app.cli import cli
from draglag_app.cli.batch import ANALYSIS_COLUMNS, Outcome, Sparkline
from draglag_app.cli.many import is_one, sessions_in
from draglag_app.cli.summary_page import page, sparkline
from draglag_app.parallel import Unavailable, spread

SAMPLES = Path(__file__).parent.parent / "data" / "exchange"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of twelve small sessions, each of six other runs, two of them in a folder below."""
    whole = dl.read(SAMPLES / "none-A")
    steady = [run for run in whole.runs if run.protocol == "circle"]
    folder = tmp_path_factory.mktemp("tiny")
    (folder / "below").mkdir()
    for k in range(12):
        some = tuple(steady[(k + step) % len(steady)] for step in (0, 2, 4, 6, 8, 10))
        place = folder / "below" if k >= 10 else folder
        dl.write(replace(whole, name=f"tiny {k}", runs=some), place / f"s{k:02}.h5")
    return folder


@pytest.fixture(scope="module")
def serial(tiny: Path) -> dict[str, object]:
    done = run("analyze", tiny, "--jobs", 1, "--json")
    assert done.exit_code == 0, done.stderr
    found: dict[str, object] = json.loads(done.stdout)
    return found


def test_every_session_has_the_result_it_has_alone(tiny: Path, serial: dict) -> None:
    assert len(serial["sessions"]) == 12
    assert serial["n_failed"] == 0
    one = serial["sessions"][3]
    alone = run("analyze", one["file"], "--json")
    assert json.loads(alone.stdout) == one["result"]


@pytest.fixture(scope="module")
def hundred(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of a hundred sessions, each of one to three other runs."""
    whole = dl.read(SAMPLES / "none-A")
    steady = [run for run in whole.runs if run.protocol == "circle"]
    folder = tmp_path_factory.mktemp("hundred")
    of_runs = chain.from_iterable(combinations(steady, n) for n in (1, 2, 3))
    for k, some in enumerate(islice(of_runs, 100)):
        dl.write(replace(whole, name=f"small {k}", runs=some), folder / f"s{k:03}.h5")
    return folder


def test_a_hundred_sessions_on_all_cores_and_on_a_cluster_are_the_same(hundred: Path) -> None:
    serial = json.loads(run("analyze", hundred, "--jobs", 1, "--no-save", "--json").stdout)
    assert len({one["result"]["session"] for one in serial["sessions"]}) == 100
    assert json.loads(run("analyze", hundred, "--jobs", 2, "--no-save", "--json").stdout) == serial
    distributed = pytest.importorskip("distributed", reason="a cluster needs Dask (extra cluster)")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        done = run("analyze", hundred, "--scheduler", cluster.scheduler_address, "--no-save", "--json")
        assert done.exit_code == 0, done.stderr
        assert json.loads(done.stdout) == serial


def test_one_table_one_page_and_what_failed(tiny: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.h5"
    broken.write_text("no session")
    table, runs, summary = tmp_path / "t.csv", tmp_path / "r.parquet", tmp_path / "s.html"
    done = run(
        "analyze", tiny / "s0[0-2].h5", broken, "--jobs", 1, "--out", table, "--runs", runs, "--summary", summary
    )
    assert done.exit_code == 1
    assert "1 of 4 sessions failed" in done.stderr
    assert f"failed: {broken}: " in done.stderr
    assert "Traceback" not in done.stderr
    rows = list(csv.DictReader(table.open()))
    assert tuple(rows[0]) == ANALYSIS_COLUMNS
    assert [Path(row["file"]).name for row in rows] == ["s00.h5", "s01.h5", "s02.h5", "broken.h5"]
    assert [bool(row["problem"]) for row in rows] == [False, False, False, True]
    assert float(rows[0]["latency_200_mm_s_low_ms"]) < float(rows[0]["latency_200_mm_s_ms"])
    frame = pandas.read_parquet(runs)
    assert len(frame) == 18
    assert frame["latency_ms"].between(20, 200).all()
    text = summary.read_text("utf-8")
    assert text.count("<svg") == 4
    for picture in re.findall(r"<svg.*?</svg>", text):
        ElementTree.fromstring(picture)
    again = run("analyze", tiny, "--out", table)
    assert (again.exit_code, "exists already" in again.stderr) == (1, True)


def test_gaps_of_many_are_a_row_each(tmp_path: Path) -> None:
    whole = dl.read(SAMPLES / "none-A")
    few = dl.write(replace(whole, runs=whole.runs[:2]), tmp_path / "few.h5")
    table, summary = tmp_path / "gaps.csv", tmp_path / "gaps.html"
    done = run("gap", SAMPLES / "none-A", few, "--jobs", 1, "--max-effects", 1, "--out", table, "--summary", summary)
    assert done.exit_code == 1
    assert "1 of 2 sessions failed" in done.stderr
    sound, poor = csv.DictReader(table.open())
    assert (sound["verdict"], sound["effects"], sound["problem"]) == ("no_gap", "", "")
    assert 0.5 < float(sound["gap_last_mm"]) / float(sound["noise_floor_mm"]) < 2
    assert poor["problem"].startswith("no verdict: ")
    assert summary.read_text("utf-8").count("<svg") == 2


def test_which_sessions_a_path_names(tiny: Path, tmp_path: Path) -> None:
    assert len(sessions_in([tiny])) == 12
    assert sessions_in([tiny / "s00.h5", tiny / "*0.h5"]) == [tiny / "s00.h5"]
    assert sessions_in([SAMPLES]) == [SAMPLES / "low_speed_plateau", SAMPLES / "none-A"]
    assert is_one([SAMPLES / "none-A"])
    assert is_one([tmp_path / "not-there.h5"])
    assert not is_one([SAMPLES])
    with pytest.raises(dl.DataError, match="holds no session"):
        sessions_in([tmp_path / "*.h5"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--save-model", "m.json"), "--save-model works on one session"),
        (("--out", "t.xlsx"), ".csv or .parquet"),
    ],
)
def test_options_of_one_session_are_refused_for_many(tiny: Path, arguments: tuple[str, ...], said: str) -> None:
    done = run("analyze", tiny, *arguments)
    assert done.exit_code == 2
    assert said in done.stderr


def test_options_of_many_are_refused_for_one(tiny: Path, tmp_path: Path) -> None:
    done = run("analyze", tiny / "s00.h5", "--out", tmp_path / "t.csv")
    assert done.exit_code == 2
    assert "--out is of many sessions" in done.stderr


def test_a_scheduler_that_is_not_there_is_one_sentence(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("draglag_app.parallel.ANSWERS_S", 0.5)
    done = run("analyze", tiny, "--scheduler", "tcp://127.0.0.1:9")
    assert done.exit_code == 1
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("draglag: ")]
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in line
    with pytest.raises(Unavailable):
        list(spread(abs, [1], scheduler="tcp://127.0.0.1:9"))


def test_names_in_the_page_are_no_markup() -> None:
    evil = "<script>alert(1)</script>"
    text = page(
        "t", ["file", "x"], [(Outcome(evil, {}), [evil, "1"]), (Outcome("f", {}, problem=evil), ["f", "2"])], ""
    )
    assert evil not in text
    assert text.count("&lt;script&gt;") == 2


def test_a_sparkline_is_on_the_scale_of_all() -> None:
    low = sparkline(Sparkline((0.0, 1.0), (1.0, 1.0)), (1.0, 10.0))
    high = sparkline(Sparkline((0.0, 1.0), (10.0, 10.0)), (1.0, 10.0))
    y_low, y_high = (float(re.search(r'points="[\d.]+,([\d.]+)', one)[1]) for one in (low, high))  # type: ignore[index]
    assert y_high < y_low  # y grows downwards
    assert "<svg" in sparkline(Sparkline(), (1.0, 1.0))


def test_many_screens_are_ranked_and_what_fails_is_listed(tiny: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.h5"
    broken.write_text("no session")
    out, report = tmp_path / "order.csv", tmp_path / "order.html"
    done = run("compare", tiny, broken, "--jobs", 1, "--out", out, "--report", report)
    assert done.exit_code == 1
    assert f"failed: {broken}: " in done.stderr
    assert "mean latency ms" in done.stdout
    rows = list(csv.DictReader(out.open()))
    assert [int(row["rank"]) for row in rows] == list(range(1, 13))
    assert all(int(row["rank_low"]) <= int(row["rank"]) <= int(row["rank_high"]) for row in rows)
    assert report.read_text("utf-8").count("<img ") == 2


def test_compare_says_of_a_session_without_a_curve_what_to_do(tmp_path: Path) -> None:
    session = dl.read(SAMPLES / "none-A")
    for name, kept in (("a", session), ("b", session), ("c", replace(session, runs=session.runs[:1]))):
        dl.write(replace(kept, name=name), tmp_path / f"{name}.h5")
    done = CliRunner().invoke(cli, ["compare", *(str(tmp_path / f"{name}.h5") for name in "abc")])
    lines = [line for line in done.stderr.splitlines() if "c.h5" in line]
    assert f"{tmp_path / 'c.h5'}: there is no curve. See draglag analyze for the verdict on its runs." in "".join(lines)
