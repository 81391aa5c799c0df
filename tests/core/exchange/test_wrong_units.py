"""Files whose numbers are in another unit than they say: refused or pointed out, in one sentence."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from draglag.analysis import analyze
from draglag.errors import DataError
from draglag.exchange import read_exchange
from draglag.exchange.importers import HowToRead, parse_map, read_recordings
from draglag.exchange.tables import write_table
from draglag.reading.off_screen import off_screen
from draglag.recording import Run, Session

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"


@pytest.fixture(scope="module")
def circle() -> Session:
    """A session of one circle."""
    session = read_exchange(SAMPLE)
    return replace(session, runs=(next(run for run in session.runs if run.protocol == "circle"),), taps=None)


def touch_table(path: Path, run: Run, times: float) -> None:
    """The touch events with their times multiplied."""
    write_table(path, {"t_s": times * run.touch.t_s, "x_mm": run.touch.x_mm, "y_mm": run.touch.y_mm})


def folder_of(folder: Path, session: Session, times: float) -> Path:
    """An exchange folder of the run with its times multiplied."""
    screen, (run,) = session.screen, session.runs
    folder.mkdir()
    touch_table(folder / "a.touch.csv", run, times)
    write_table(folder / "a.laser.csv", {"t_s": times * run.laser.t_s, "light": run.laser.light})
    part = {"id": "a", "protocol": "circle", "nominal_speed_mm_s": None, "radius_mm": None, "start_s": None,
            "duration_s": None}  # fmt: skip
    panel = {"name": "s", "width_mm": screen.width_mm, "height_mm": screen.height_mm, "width_px": screen.width_px,
             "height_px": screen.height_px}  # fmt: skip
    head = {"format": "draglag-exchange", "version": 1, "clock": "one", "stylus_diameter_mm": 7.0, "screen": panel,
            "runs": [part], "taps": None}  # fmt: skip
    (folder / "session.json").write_text(json.dumps(head), "utf-8")
    return folder


# The panel sends an event every 10 ms.
@pytest.mark.parametrize(("times", "said"), [(1e3, "one every 10 s"), (1e6, "one every 1e+04 s")])
def test_times_in_milliseconds_or_less_are_refused(circle: Session, tmp_path: Path, times: float, said: str) -> None:
    with pytest.raises(DataError) as refused:
        read_exchange(folder_of(tmp_path / "folder", circle, times))
    place = f"{tmp_path / 'folder' / 'a.touch.csv'}: the events of a run come {said} on the median"
    assert str(refused.value) == f"{place}, as from no touchscreen. Give all times in seconds."
    touch_table(tmp_path / "a.csv", circle.runs[0], times)
    with pytest.raises(DataError) as refused:
        read_recordings((tmp_path / "a.csv",), HowToRead(screen=circle.screen))
    assert f"a.csv: the events of a run come {said} on the median" in str(refused.value)
    assert refused.value.remedy == "Give the unit of the time, as in --map t=COLUMN:ms."


def test_with_their_unit_such_times_are_read(circle: Session, tmp_path: Path) -> None:
    touch_table(tmp_path / "a.csv", circle.runs[0], 1e3)
    read = read_recordings((tmp_path / "a.csv",), HowToRead(screen=circle.screen, map=parse_map(["t=t_s:ms"])))
    np.testing.assert_allclose(read.runs[0].touch.t_s, circle.runs[0].touch.t_s, rtol=1e-12)


def test_a_few_events_far_apart_are_no_reason_to_refuse_a_session(circle: Session, tmp_path: Path) -> None:
    (run,) = circle.runs
    seven = replace(run, touch=replace(run.touch, t_s=run.touch.t_s[:7], x_mm=run.touch.x_mm[:7],
                                       y_mm=run.touch.y_mm[:7], contact_id=run.touch.contact_id[:7]))  # fmt: skip
    folder = folder_of(tmp_path / "folder", replace(circle, runs=(seven,)), 1e3)
    assert len(read_exchange(folder).runs[0].touch.t_s) == 7


def test_a_session_file_of_such_times_has_no_latency(circle: Session) -> None:
    (run,) = circle.runs
    touch, laser = replace(run.touch, t_s=1e3 * run.touch.t_s), replace(run.laser, t_s=1e3 * run.laser.t_s)
    (found,) = analyze(replace(circle, runs=(replace(run, touch=touch, laser=laser),))).runs
    assert found.latency_s is None
    assert "no_touch" in found.flags


def wide(session: Session, times: float) -> Session:
    """The session with its positions across multiplied."""
    (run,) = session.runs
    return replace(session, runs=(replace(run, touch=replace(run.touch, x_mm=times * run.touch.x_mm)),))


def test_touches_off_the_screen_are_pointed_out_in_one_sentence(circle: Session, tmp_path: Path) -> None:
    far = wide(circle, 3.0)
    touch, screen = far.runs[0].touch, far.screen
    reach = f"from {touch.x_mm.min():.4g} to {touch.x_mm.max():.4g} mm across and {touch.y_mm.min():.4g} to "
    reach += f"{touch.y_mm.max():.4g} mm down, on a screen that is stated to be {screen.width_mm:.4g} × "
    said = f"{reach}{screen.height_mm:.4g} mm: a size or the positions are in a wrong unit, or the calibration is "
    said += "another screen's."
    own = f"The touches of {far.runs[0].id} reach {said}"
    assert [text for text in analyze(far).warnings if "touches" in text] == [own]
    folder = read_exchange(folder_of(tmp_path / "folder", far, 1.0))
    assert [note.text for note in folder.notes if "touches" in note.text] == [f"The touches of a reach {said}"]
    touch_table(tmp_path / "a.csv", far.runs[0], 1.0)
    table = read_recordings((tmp_path / "a.csv",), HowToRead(screen=screen))
    assert [note.text for note in table.notes if "touches" in note.text] == [f"The touches of a reach {said}"]


@pytest.mark.parametrize(("share", "beyond", "said"), [(0.02, 0.06, 1), (0.02, 0.04, 0), (0.009, 9.0, 0)])
def test_a_few_touches_or_a_little_off_the_screen_are_nothing_to_say(
    circle: Session, share: float, beyond: float, said: int
) -> None:
    (run,) = circle.runs
    x_mm = run.touch.x_mm.copy()
    assert x_mm.max() < circle.screen.width_mm
    x_mm[: round(share * x_mm.size)] = (1 + beyond) * circle.screen.width_mm
    assert len(off_screen(circle.screen, (replace(run, touch=replace(run.touch, x_mm=x_mm)),))) == said
