"""What instruments say reaches the operator in the operator's language, with its names and numbers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from PySide6.QtWidgets import QApplication

from draglag.messages import Message, message, phrase
from draglag_app.session import events
from draglag_app.session.readers import OpenFaults
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.button_words import IN_BUTTONS
from draglag_app.windows.wording.i18n import use_language
from draglag_app.windows.wording.library_words import fault_words, in_words, source_name
from draglag_app.windows.wording.library_words import sentences as in_sentences
from draglag_devices.addresses import ROLES
from draglag_devices.ethercat_laser.disturbed import Disturbances
from draglag_devices.ethercat_laser.finding import _entry
from draglag_devices.ethercat_laser.preflight import INSTALL
from draglag_devices.ethercat_laser.probe import NOT_ALLOWED
from draglag_devices.rig import make_rig
from draglag_devices.source import DeviceError
from message_templates import example, has_words, sentences

ADDRESS = "evdev:/dev/input/event7"


@pytest.fixture
def dutch(qapp: QApplication) -> Iterator[None]:
    use_language(qapp, "nl")
    yield
    use_language(qapp, "en")


def templates() -> list[str]:
    """Of every sentence that an instrument says."""
    found = {s.template for s in sentences() if s.template and s.file.startswith("draglag_devices")}
    return sorted(text for text in found if has_words(text))


def test_every_sentence_of_an_instrument_is_dutch_with_what_is_filled_in(dutch: None) -> None:
    known = templates()
    assert len(known) > 130
    for template in known:
        said, given = in_words(example(template)), example(template)
        assert said != given, template
        shown = IN_BUTTONS.get(template, template)
        for name, value in given.arguments.items():
            if f"{{{name}" in shown and name != "role":
                assert str(value) in said or "7.5" in said or " 8" in said, said


def test_a_fault_is_dutch_in_both_its_halves(dutch: None) -> None:
    error = DeviceError(
        ADDRESS,
        message("the WALT was unplugged ({why})", why=phrase("No such device")),
        message("install the helper again, as administrator: {command}", command="sudo ./run install {name}"),
    )
    assert in_words(error.message) == (
        f"{ADDRESS}: de WALT is losgekoppeld (geen apparaat meer); installeer het hulpprogramma opnieuw, "
        "als beheerder: sudo ./run install {name}."
    )


def test_several_faults_reported_together_are_all_translated(dutch: None) -> None:
    touch = DeviceError(ADDRESS, "there is no such device", "plug it in; draglag devices lists what is there")
    laser = DeviceError(
        "ethercat:eno1",
        message("the network interface {name} is switched off", name="eno1"),
        message("switch it on as administrator: {command}", command="sudo ip link set eno1 up"),
    )
    said = in_words(OpenFaults((touch, laser)).message)
    assert said == (
        f"{ADDRESS}: dit apparaat is er niet; sluit het aan; Apparaten zoeken toont wat er is. "
        "ethercat:eno1: de netwerkinterface eno1 staat uit; zet hem aan als beheerder: sudo ip link set eno1 up."
    )


def test_english_stays_as_the_driver_said_it(qapp: QApplication) -> None:
    for template in templates():
        if template not in IN_BUTTONS and "{role" not in template:
            assert in_words(example(template)) == example(template)
    assert fault_words("evdev:x: it was unplugged (gone).", "plug it in again.") == (
        "evdev:x: it was unplugged (gone); plug it in again."
    )
    assert (source_name("touch"), source_name(ADDRESS)) == ("touchscreen", ADDRESS)


def test_disturbed_cycles_are_counted_in_dutch(dutch: None) -> None:
    notice = Disturbances().take(0.0, 60.0, 60_000, {"lost": 700, "stale": 30})
    assert notice is not None
    assert notice.text == (
        "1.2 % of the EtherCAT cycles of the last 60 s were disturbed: 700 without an answer, 30 with old data. Where "
        "edges may be missing is marked. Close other programs, check the cable and the supply of the coupler."
    )
    assert in_words(notice.text) == (
        "1.2 % van de EtherCAT-cycli van de laatste 60 s was gestoord: 700 zonder antwoord, 30 met oude gegevens. Waar "
        "flanken kunnen ontbreken is gemarkeerd. Sluit andere programma's, controleer de kabel en de voeding van de "
        "koppelaar."
    )


def test_a_device_that_is_lost_is_reported_in_dutch(open_window: Callable[..., OperatorWindow], dutch: None) -> None:
    window = open_window(language="nl")
    problem = message("the WALT was unplugged ({why})", why=phrase("hung up"))
    error = DeviceError("serial:/dev/ttyACM0", problem, "plug it in again")
    window.space.bridge.device_fault.emit(events.DeviceFault("walt", error.source, error.problem, error.remedy))
    wanted = "serial:/dev/ttyACM0: de WALT is losgekoppeld (verbinding verbroken); sluit het weer aan."
    assert window.notice_text.text() == wanted
    assert window.header.lights["walt"].toolTip() == wanted
    log = window.pages["log"][1].table
    last = log.rowCount() - 1
    assert log.item(last, 3).text() == wanted
    assert log.item(last, 1).text() == "✕ fout"


def test_a_device_that_is_lost_and_back_is_shown_as_recovered(open_window: Callable[..., OperatorWindow]) -> None:
    window = open_window()
    raised = window.space.bridge.notice_raised
    raised.emit(events.NoticeRaised(1.0, "error", "touch", "Panel is gone (unplugged). Plug it in again.", "lost"))
    light = window.header.lights["touch"]
    assert (light.state, window.notice.property("level")) == ("fault", "error")
    raised.emit(events.NoticeRaised(2.0, "info", "touch", "Panel is back at /dev/input/event7.", "back"))
    assert (light.state, window.notice.property("level")) == ("live", "info")
    assert window.notice_text.text() == "touchscreen: Panel is back at /dev/input/event7."
    assert light.toolTip() == "Panel is back at /dev/input/event7."


SEEN: dict[str, Any] = {
    "name": "eno1", "up": True, "carrier": True, "rights": True, "busy": False, "slaves": 0, "kinds": [],
    "left_alone": "",
}  # fmt: skip
_LOOK = "voer om daar te zoeken ethercat:eno1 in als lasersensor en kies Opstelling controleren"


@pytest.mark.parametrize(
    ("seen", "why_helper", "description", "remedy"),
    [
        (
            {"left_alone": message("has the address {ip}", ip="10.0.0.4")},
            "",
            "netwerkinterface eno1: heeft het adres 10.0.0.4",
            _LOOK,
        ),
        (
            {"left_alone": message("belongs to {name}", name="br0")},
            "",
            "netwerkinterface eno1: hoort bij br0",
            _LOOK,
        ),
        ({"left_alone": message("is wireless")}, "", "netwerkinterface eno1: is draadloos", _LOOK),
        (
            {"left_alone": NOT_ALLOWED},
            "",
            "netwerkinterface eno1: was niet toegestaan toen het EtherCAT-hulpprogramma werd geïnstalleerd",
            f"installeer het opnieuw voor deze interface, als beheerder: {INSTALL} eno1",
        ),
        (
            {"slaves": 2, "kinds": [(2, 1), (2, 3)]},
            "",
            "EtherCAT-bus op eno1, 2 apparaten, geen EK1101 met een EL1252: "
            "leverancier 0x2 product 0x00000001, leverancier 0x2 product 0x00000003",
            "sluit de EK1101 (of een EK1100) met de EL1252 aan, of kies de interface waarop ze zitten",
        ),
        (
            {},
            message("the EtherCAT helper failed ({why})", why="exit 2"),
            "netwerkinterface eno1: het EtherCAT-hulpprogramma mislukte (exit 2)",
            f"installeer het hulpprogramma opnieuw, als beheerder: {INSTALL} eno1",
        ),
    ],
)
def test_what_a_look_around_finds_is_dutch(
    dutch: None, seen: dict[str, Any], why_helper: str, description: str, remedy: str
) -> None:
    found = _entry(SEEN | seen, why_helper)
    assert (in_words(found.description), in_words(found.remedy)) == (description, remedy)


def test_what_instruments_say_of_themselves_is_dutch(dutch: None) -> None:
    for source in make_rig(dict.fromkeys(ROLES, "sim:"), "screen-1", fast=True).sources:
        info = source.open()
        source.close()
        assert in_words(info.description) == f"gesimuleerd: {source_name(source.role)}, screen-1"
        assert in_words(info.clock) != info.clock
    said = message("{names} on {interface}, channel {channel}", names="EK1100, EL1252", interface="enp3s0", channel=1)
    assert in_words(said) == "EK1100, EL1252 aan enp3s0, kanaal 1"
    assert in_words("a touchscreen of some maker") == "a touchscreen of some maker"


def test_flags_of_runs_are_named_as_in_the_table_and_sentences_end() -> None:
    none = message("{run}: no latency ({flags})", run="run-03", flags="off_speed, few_edges")
    said = in_sentences((none, "Too few runs. Record runs at more speeds."))
    assert said == "run-03: no latency (off speed, few edges). Too few runs. Record runs at more speeds."


def test_places_of_a_sentence_stay_the_same_in_the_words_of_the_windows() -> None:
    for template, shown in IN_BUTTONS.items():
        there, wanted = (Counter(re.findall(r"{\w+[^}]*}", text)) for text in (template, shown))
        assert not wanted - there, template
    assert isinstance(example("{name} is gone"), Message)
