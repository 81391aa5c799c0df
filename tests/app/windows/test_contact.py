"""Whether the stylus is on the screen, and that the participant is asked to put it back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from draglag.recording import TouchTrace
from draglag_app.session.digest import digest
from draglag_app.session.events import SamplesArrived
from draglag_app.session.machine import Phase
from draglag_app.windows.participant.contact import Contact
from draglag_devices.source import Batch, ContactChanges


def touches(until_s: float, *changes: tuple[int, int], last_s: float | None = None) -> SamplesArrived:
    """What has arrived: (contact id, 1 began or 0 ended) each, and a touch event at ``last_s``."""
    ids, down = (np.array([change[k] for change in changes], np.int64) for k in (0, 1))
    contacts = ContactChanges(np.full(len(changes), until_s), ids, down)
    t_s = np.array([] if last_s is None else [last_s])
    touch = TouchTrace(t_s, t_s, t_s)
    event = digest("touch", "run-01", Batch(until_s, touch=touch, contacts=contacts), 0)
    assert event is not None
    return event


def test_a_lift_without_a_touch_event_is_a_lost_contact() -> None:
    contact = Contact()
    assert contact.take(touches(1.0, (7, 1), last_s=0.99))
    assert not contact.take(touches(2.0, (7, 0)))
    assert contact.take(touches(3.0, (8, 1)))


def test_a_stylus_that_stands_still_is_on_the_screen_and_one_of_two_contacts_is_enough() -> None:
    contact = Contact()
    contact.take(touches(1.0, (7, 1), (8, 1), last_s=0.99))
    assert contact.take(touches(9.0, (8, 0)))


def test_a_source_that_reports_no_contacts_is_judged_by_the_age_of_its_touches() -> None:
    contact = Contact()
    assert contact.take(touches(1.0, last_s=0.99))
    assert not contact.take(touches(2.0, last_s=0.99))


@pytest.mark.usefixtures("short_countdown")
def test_the_participant_sees_it_in_a_run(open_window: Callable, until: Callable) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    window.space.set_protocol(window.space.protocol.model_copy(update={"taps": None}))
    window.ask("start")
    participant = window.space.recording.window
    until(lambda: window.record._phase is Phase.RECORDING and "Keep" in participant._present_words())
    until(lambda: participant._present_words() == "")  # what is said at first is over
    contacts = set(window.space.recording._contact._down)
    window.space.bridge.samples_arrived.emit(touches(1.0, *((one, 0) for one in contacts)))
    assert "Contact lost" in participant._present_words()
    window.ask("stop")
    until(lambda: not window.space.recording.active)


@pytest.mark.parametrize("nothing", [None, ContactChanges(np.array([]), np.array([], int), np.array([], int))])
def test_a_read_without_anything_is_no_event(nothing: ContactChanges | None) -> None:
    assert digest("touch", "run-01", Batch(1.0, contacts=nothing), 0) is None
