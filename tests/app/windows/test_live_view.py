"""The live plots: drawn between the participant's frames, on axes that stay while a run goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from PySide6.QtWidgets import QApplication

from draglag.protocol.runs import PlannedRun, expand, load_protocol
from draglag.recording import Beam, Screen
from draglag_app.session import SessionOptions, events
from draglag_app.windows.parts.theme import apply_theme, theme
from draglag_app.windows.recording.live_view import LiveView
from draglag_app.windows.recording.session_thread import Order
from draglag_devices.rig import Rig

BEAM = Beam(0.01, 80.0)
SCREEN = Screen("test", 310.0, 174.0, 1920, 1080)


class Frames:
    """How long it is until the participant's next frame, s."""

    next_s = 0.0

    def __call__(self) -> float:
        return self.next_s


@pytest.fixture
def frames() -> Frames:
    return Frames()


@pytest.fixture
def view(qapp: QApplication, frames: Frames) -> Iterator[LiveView]:
    made = LiveView("Latency so far", frames)
    made.resize(1000, 500)
    made.show()
    yield made
    made.end_session()
    made.close()
    made.deleteLater()


@pytest.fixture
def planned() -> PlannedRun:
    return expand(load_protocol("demo"), SCREEN, 1)[0]


def begin(view: LiveView, planned: PlannedRun) -> None:
    order = Order(load_protocol("demo"), cast(Rig, None), Path("x.h5"), SessionOptions(SCREEN, beam=BEAM))
    view.begin_session()
    view.prepare(planned.id, order, planned)
    view.begin_run(events.RunStarted(planned.id, planned, 100.0))
    QApplication.processEvents()


def follow(view: LiveView, planned: PlannedRun, from_s: float, to_s: float, shift_mm: float = 0.0) -> None:
    """A stylus that follows the target, shifted to the right, and an edge in the middle."""
    t_s = np.arange(from_s, to_s, 0.001)
    x_mm, y_mm = planned.target.position_mm(t_s)
    edge_s = np.array([100.0 + (from_s + to_s) / 2])
    view.add(
        events.SamplesArrived(
            "touch",
            planned.id,
            100.0 + to_s,
            100.0 + t_s,
            x_mm + shift_mm,
            y_mm,
            edge_s,
            np.array([0]),
            len(t_s),
            1000.0,
            0.0,
            0,
        )
    )
    view.draw_all()
    QApplication.processEvents()


def ranges(view: LiveView) -> list[list[float]]:
    return [sides for plot in (view.trace, view.speed) for sides in plot.getPlotItem().vb.viewRange()]


def test_axes_stand_when_a_run_begins_and_stay_as_its_data_arrive(view: LiveView, planned: PlannedRun) -> None:
    begin(view, planned)
    before = ranges(view)
    (x0, x1), (y0, y1), (t0, t1), (_, fastest) = before
    assert x0 < 0 < SCREEN.width_mm < x1
    assert y0 < 0 < SCREEN.height_mm < y1
    assert t0 <= 0 < planned.duration_s <= t1
    assert fastest > planned.nominal_speed_mm_s
    for k in range(4):
        follow(view, planned, k, k + 1.0)
        assert ranges(view) == before
    assert view.n_edges == 4
    assert len(view.trace.drawn["touch"][0]) > 100
    t_s, speed_mm_s = view.speed.drawn["stylus"]
    assert np.nanmedian(speed_mm_s) == pytest.approx(planned.nominal_speed_mm_s, rel=0.05)
    assert t_s.max() > 3.8


def test_touches_off_the_screen_are_shown_too(view: LiveView, planned: PlannedRun) -> None:
    begin(view, planned)
    follow(view, planned, 0.0, 1.0, shift_mm=3 * SCREEN.width_mm)
    seen = view.trace.getPlotItem().vb.viewRange()[0]
    assert seen[0] < 0
    assert seen[1] > view.trace.drawn["touch"][0].max() > SCREEN.width_mm


def test_live_speeds_are_no_closer_together_than_they_tell_anything(view: LiveView, planned: PlannedRun) -> None:
    begin(view, planned)
    for k in range(3):
        follow(view, planned, k, k + 1.0)
    apart_s = np.diff(view.speed.drawn["stylus"][0])
    assert apart_s.min() > 0
    assert 0.005 < np.median(apart_s) < 0.02


def test_plots_wait_for_the_participants_frame(
    view: LiveView, planned: PlannedRun, frames: Frames, until: Callable[[Callable[[], bool]], None]
) -> None:
    waits: list[float] = []
    view.drawing.connect(lambda: waits.append(frames.next_s))
    frames.next_s = 3600.0
    begin(view, planned)
    asked: list[int] = []
    view._due.timeout.connect(lambda: asked.append(1))
    until(lambda: len(asked) >= 3)
    assert not waits  # the frame has not been drawn yet
    frames.next_s = 0.0
    until(lambda: bool(waits))


def test_a_frame_that_was_late_is_not_followed_by_a_plot_unless_all_are(
    view: LiveView, planned: PlannedRun, frames: Frames, until: Callable[[Callable[[], bool]], None]
) -> None:
    reported: list[int] = []
    asked: list[int] = []
    view.drawing.connect(lambda: reported.append(1))
    frames.next_s = 0.004
    begin(view, planned)
    view._frame_drawn.timeout.connect(lambda: asked.append(1))
    until(lambda: len(reported) >= 3)
    assert len(asked) >= 3 * len(reported)  # it waited for other frames before each


def test_a_change_of_theme_recolours_the_run_that_goes_on(
    qapp: QApplication, view: LiveView, planned: PlannedRun
) -> None:
    begin(view, planned)
    follow(view, planned, 0.0, 2.0)
    before = theme()
    other = apply_theme(qapp, "light" if before.name == "dark" else "dark")
    view.restyle()
    try:
        for name, colour in (("target", other.muted), ("stylus", other.blue)):
            assert view.speed._items[name][0].opts["pen"].color().name() == colour.lower()
        standing = (("screen", other.muted), ("beam", other.bad), ("target", other.line), ("touch", other.blue))
        for name, colour in standing:
            assert view.trace._items[name][0].opts["pen"].color().name() == colour.lower()
    finally:
        apply_theme(qapp, before.name)
