"""A touchscreen that was turned after its calibration is reported while the run goes on, and kept in the file."""

from dataclasses import replace

import pytest

from app.session_rigs import Recording, Wrapped, fast_rig, of_role, protocol, replaced
from draglag.protocol.presets import load_screen
from draglag.recording import TouchTrace
from draglag.store import read_session
from draglag_app.session import events

PANEL = load_screen("screen-1")


class Turned(Wrapped):
    """A touchscreen that reports every touch at its mirror image."""

    def __init__(self, inner, left_right, top_bottom):
        super().__init__(inner)
        self.left_right, self.top_bottom = left_right, top_bottom

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        touch = batch.touch
        if touch is None:
            return batch
        x_mm = PANEL.width_mm - touch.x_mm if self.left_right else touch.x_mm
        y_mm = PANEL.height_mm - touch.y_mm if self.top_bottom else touch.y_mm
        return replace(batch, touch=replace(touch, x_mm=x_mm, y_mm=y_mm))


def reported(recording):
    return [event for event in recording.of(events.NoticeRaised) if "against the target" in event.text]


@pytest.mark.parametrize(
    ("left_right", "top_bottom", "words"),
    [(True, True, "turned by half a turn"), (True, False, "left to right"), (False, True, "top to bottom")],
)
def test_a_mirrored_touchscreen_is_reported_with_the_remedy_before_the_run_ends(
    tmp_path, left_right, top_bottom, words
):
    rig = fast_rig()
    source = Turned(of_role(rig, "touch"), left_right, top_bottom)
    recording = Recording(protocol(180, duration_s=12.0), replaced(rig, source), tmp_path / "s.h5")
    assert recording.error is None
    (notice,) = reported(recording)
    assert words in notice.text
    assert "calibrate the touchscreen again" in notice.text
    assert (notice.level, notice.source) == ("error", "touch")
    ends = recording.of(events.RunFinished)
    assert recording.events.index(notice) < recording.events.index(ends[0])
    (run,) = read_session(recording.path).runs
    assert notice.text in [entry.text for entry in run.log]
    assert notice.t_s < run.start_s + 2.6


def test_the_right_way_round_nothing_is_said(tmp_path):
    recording = Recording(protocol(60, 180, 900, duration_s=8.0), fast_rig(), tmp_path / "s.h5")
    assert recording.error is None
    assert reported(recording) == []


class Late(Turned):
    """A turned touchscreen, and a hand that comes to it only some seconds after the target began to move."""

    first_s = None

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        touch = batch.touch
        if touch is None or not len(touch.t_s):
            return batch
        self.first_s = float(touch.t_s[0]) if self.first_s is None else self.first_s
        keep = touch.t_s > self.first_s + 6.0
        held = TouchTrace(touch.t_s[keep], touch.x_mm[keep], touch.y_mm[keep], touch.contact_id[keep])
        return replace(batch, touch=held)


def test_a_hand_that_comes_late_is_looked_at_again_and_reported_once(tmp_path):
    rig = fast_rig()
    recording = Recording(
        protocol(180, duration_s=16.0), replaced(rig, Late(of_role(rig, "touch"), True, True)), tmp_path / "s.h5"
    )
    assert recording.error is None
    (notice,) = reported(recording)
    (run,) = read_session(recording.path).runs
    assert 4.0 < notice.t_s - run.start_s < 12.0
