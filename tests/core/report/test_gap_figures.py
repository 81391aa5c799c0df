"""The bars of a gap report: what is provisional looks it."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.colors import to_hex

from draglag.analysis import with_stylus
from draglag.drawing import style
from draglag.exchange import read_exchange
from draglag.gap import close_gap
from draglag.gap.provisional import Provisional
from draglag.gap.replaying.replay import Replay
from draglag.gap.results import GapReport, Step
from draglag.recording import Session
from draglag.report.gap import write_gap_report
from draglag.report.gap_figures import spread, waterfall
from draglag.report.replayed import edges_figure

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"
NONE = np.zeros(2)
UNNAMED = Provisional(
    "unnamed:session_time", "session_time", "latency", 0.8, 0.25, 0.12, 0.1, True, NONE, NONE, NONE, NONE
)


def step(effect: str, before_mm: float, after_mm: float, probability: float) -> Step:
    return Step(effect, {}, "", "speed", 1e-6, "", before_mm, after_mm, probability)


def made_of(*steps: Step) -> GapReport:
    return GapReport(
        "s", "unexplained", steps=steps, unexplained_by="session_time", gap_first_mm=0.6, gap_last_mm=0.25,
        noise_floor_mm=0.1,
    )  # fmt: skip


SURE, DOUBTED = step("clock_drift", 0.6, 0.3, 0.9), step("beam_bow", 0.3, 0.25, 0.1)


def bars(drawn: Any) -> list[tuple[str, float, bool, str]]:
    """Name, height, whether hatched, and colour of each bar, from left to right."""
    (axes, *_) = drawn.axes
    found = sorted(axes.patches, key=lambda bar: bar.get_x())
    names = [text.get_text() for text in axes.get_xticklabels()]
    return [
        (name, bar.get_height(), bool(bar.get_hatch()), to_hex(bar.get_edgecolor()))
        for name, bar in zip(names, found, strict=True)
    ]


def legend(drawn: Any) -> dict[str, bool]:
    """Words in the legend, and whether what stands next to them is hatched."""
    found = drawn.axes[0].get_legend()
    hatched = [bool(getattr(one, "get_hatch", lambda: None)()) for one in found.legend_handles]
    return dict(zip((text.get_text() for text in found.get_texts()), hatched, strict=True))


def test_bars_of_what_is_provisional_are_hatched_marked_and_named_in_the_legend() -> None:
    with style.house_style():
        drawn = waterfall(made_of(SURE, DOUBTED), UNNAMED)
        first, sure, doubted, unnamed = bars(drawn)
    assert [bar[2] for bar in (first, sure, doubted, unnamed)] == [False, False, True, True]
    assert [bar[1] for bar in (first, sure, doubted, unnamed)] == [0.6, 0.3, 0.25, 0.12]
    assert "~" not in first[0] + sure[0]
    assert "~" in doubted[0]
    assert "~" in unnamed[0]
    assert "the session time" in " ".join(unnamed[0].split())
    assert doubted[3] == unnamed[3] != sure[3]
    assert legend(drawn) == {"noise floor": False, "provisional": True}


def test_without_anything_provisional_nothing_is_hatched() -> None:
    with style.house_style():
        drawn = waterfall(made_of(SURE))
    assert [hatched for _, _, hatched, _ in bars(drawn)] == [False, False]
    assert legend(drawn) == {"noise floor": False}


def test_names_below_the_bars_of_a_full_figure_do_not_run_into_each_other() -> None:
    third = step("direction_asymmetry", 0.25, 0.2, 0.2)
    with style.house_style():
        drawn = waterfall(made_of(SURE, DOUBTED, third), UNNAMED)
        drawn.draw_without_rendering()
        boxes = [text.get_window_extent() for text in drawn.axes[0].get_xticklabels()]
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))


@pytest.mark.parametrize("runs", [14, 42, 200])
def test_speeds_below_the_runs_of_a_long_session_do_not_run_into_each_other(runs: int) -> None:
    speeds_mm_s = np.geomspace(40, 1000, runs)
    run = np.repeat(np.arange(runs), 10)
    measured_s = np.arange(run.size, dtype=float)
    each: Any = [
        SimpleNamespace(id=f"run-{k}", protocol="circle", measured=SimpleNamespace(speed_mm_s=v))
        for k, v in enumerate(speeds_mm_s)
    ]
    falling, nothing = np.tile([True, False], run.size // 2), cast("Any", None)
    between_s = np.zeros(runs)
    replay = Replay(
        (), nothing, tuple(each), run, measured_s, measured_s, falling, np.ones(run.size), nothing, nothing, between_s
    )
    with style.house_style():
        drawn = edges_figure(replay, replay)
        drawn.draw_without_rendering()
        labels = drawn.axes[1].get_xticklabels()
        middles = [np.mean([text.get_window_extent().x0, text.get_window_extent().x1]) for text in labels]
    height = labels[0].get_fontsize() * drawn.dpi / 72
    assert labels[0].get_rotation() == 45
    assert len(labels) >= 10
    assert np.diff(middles).min() * np.sin(np.radians(45)) > height  # between lines of text that lie at 45°


@pytest.fixture(scope="module")
def session() -> Session:
    """Five runs of a sample."""
    whole = read_exchange(SAMPLE)
    return replace(whole, runs=whole.runs[:5])


@pytest.fixture(scope="module")
def report(session: Session) -> GapReport:
    return close_gap(session, max_effects=0)


def test_the_page_draws_the_provisional_term_that_it_reports(
    session: Session, report: GapReport, tmp_path: Path
) -> None:
    for unnamed in (None, UNNAMED):
        text = write_gap_report(session, report, tmp_path / "gap.html", provisional=unnamed).read_text("utf-8")
        steps = re.findall(r"<svg.*?</svg>", text, re.DOTALL)[0]
        assert ("Provisional term unnamed:session_time" in text) is (unnamed is not None)
        assert ("<pattern" in steps) is (unnamed is not None)  # what a hatched area is filled with


def test_edges_of_an_unsure_state_are_neither_counted_nor_drawn(
    session: Session, report: GapReport, tmp_path: Path
) -> None:
    last = report.last
    assert last is not None
    known = last.known.copy()
    known[np.flatnonzero(last.use)[:40]] = False
    partly = replace(last, known=known)
    page = write_gap_report(session, replace(report, last=partly), tmp_path / "gap.html").read_text("utf-8")
    counted = np.count_nonzero(last.use) - 40
    said = rf"\b{counted} edges of \d+ runs, 40 more are near a switch"
    assert re.search(said, re.sub("<[^>]+>", "", page))
    with style.house_style():
        after = spread(last, partly).axes[0].patches[1].get_xy()
    assert after[1:-1:2, 1].sum() == counted


def test_the_page_states_the_diameter_that_it_was_judged_with(session: Session, tmp_path: Path) -> None:
    wider = with_stylus(session, 8.25)
    page = write_gap_report(wider, close_gap(wider, max_effects=0), tmp_path / "gap.html").read_text("utf-8")
    assert 'stylus <span class="number">8.25 mm</span>' in page


def test_the_page_breaks_no_line_between_a_number_and_its_unit_or_within_a_p_value(
    session: Session, report: GapReport, tmp_path: Path
) -> None:
    page = write_gap_report(session, replace(report, steps=(SURE,)), tmp_path / "gap.html").read_text("utf-8")
    text = re.sub(r"<(svg|style|head)\b.*?</\1>", "", page, flags=re.DOTALL)
    whole = re.findall(r'<span class="number">(.*?)</span>', text)
    assert "p &lt; 0.001" in whole
    assert f"{report.gap_last_mm:.3f} mm" in whole
    assert ".number{white-space:nowrap}" in page
    breakable = re.sub(r'<(\w+) class="number">.*?</\1>', "", text)
    assert re.findall(r"\bp (?:=|&lt;) |\d (?:mm|ms|%)", breakable) == []
