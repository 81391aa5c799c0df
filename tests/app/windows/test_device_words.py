"""What instruments say reaches the operator in the operator's language, with its names and numbers."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

import draglag_devices
from draglag_app.session import events
from draglag_app.session.readers import OpenFaults
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import use_language
from draglag_app.windows.wording.library_words import fault_words, in_words, sentences, source_name
from draglag_devices.addresses import ROLES
from draglag_devices.rig import make_rig
from draglag_devices.source import DeviceError

ROOMS = ("evdev_touch", "ethercat_laser", "walt")
ADDRESS = "evdev:/dev/input/event7"


@pytest.fixture
def dutch(qapp: QApplication) -> Iterator[None]:
    use_language(qapp, "nl")
    yield
    use_language(qapp, "en")


def _said(node: ast.expr) -> list[str]:
    """The texts an argument may be, with X7 for what is filled in; none where it is not written there."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    if isinstance(node, ast.JoinedStr):
        return ["".join(str(v.value) if isinstance(v, ast.Constant) else "X7" for v in node.values)]
    if isinstance(node, ast.BinOp):
        return [a + b for a in _said(node.left) or ["X7"] for b in _said(node.right) or ["X7"]]
    return []


def faults() -> list[tuple[str, str]]:
    """Every problem and remedy written in the drivers of real instruments."""
    found = []
    for room in ROOMS:
        for file in sorted((Path(draglag_devices.__file__).parent / room).glob("*.py")):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("DeviceError", "Refusal"):
                    remedies = _said(node.args[2]) if len(node.args) > 2 else []
                    found += [(text, (remedies or [""])[0]) for text in _said(node.args[1])]
    return found


def test_every_fault_of_a_driver_is_dutch_in_both_its_halves(dutch: None) -> None:
    known = faults()
    assert len(known) > 40
    english = []
    for problem, remedy in known:
        # The driver puts what is known of a reason in brackets behind it, or nothing.
        problem = problem.replace("shouldX7", "should (X7)").replace("unexpectedlyX7", "unexpectedly (X7)")
        said = in_words(str(DeviceError(ADDRESS, problem, remedy)))
        assert said.startswith(f"{ADDRESS}: ")
        # A reason within the problem is not the driver's to say.
        if f": {problem}" in said or (remedy and remedy in said and not remedy.startswith("pip ")):
            english.append((problem, remedy))
        assert said.count("X7") == f"{problem} {remedy}".count("X7"), said
    assert english == []


@pytest.mark.parametrize(
    "sentence",
    [
        "ILITEK multi-touch is gone (No such device). Plug it in again; it goes on then.",
        "ILITEK multi-touch is back at /dev/input/event7 and records again.",
        "The kernel's buffer overflowed: touch events were lost, the gap is marked.",
        "The touchscreen is not used exclusively: another program holds it.",
        "ILITEK multi-touch sends events that are no touch (ABS_Z, ABS_RX), and nothing is recorded of them. Choose "
        "another input device: draglag devices lists touchscreens.",
        "The laser sensor is lost: the cable on enp3s0 is unplugged or the other end is off. draglag tries to bring it "
        "back.",
        "The laser sensor is lost: the network interface enp3s0 was switched off (sudo ip link set enp3s0 up). draglag "
        "tries to bring it back.",
        "The laser sensor is lost: the network interface enp3s0 is gone: its adapter was unplugged or it was deleted. "
        "draglag tries to bring it back.",
        "0.12 % of the EtherCAT cycles of the last 60 s were disturbed: 72 without an answer. Where edges may be "
        "missing is marked.",
        "3 % of the EtherCAT cycles of the last 1 s were disturbed: 30 with old data. Where edges may be missing is "
        "marked. Close other programs, check the cable and the supply of the coupler.",
        "The laser sensor is back after 2.41 s and records again; edges in between may be missing.",
        "1 edge of the laser came too fast to be stamped.",
        "The laser was not read for 120 ms: this computer was busy or the bus did not answer. Where edges may be "
        "missing is marked.",
        "The WALT at /dev/ttyACM0 is gone (hung up). Plug it in again; it goes on then.",
        "The WALT at /dev/ttyACM0 is back and records again; its clock began at 0.",
        "3 edges of the laser were lost by the WALT; the gap is marked.",
        "No touch has come in the first 4 s of run-01: check that the stylus is on the screen under test and that this "
        "is the touchscreen in use.",
        "No touch was recorded in any run. Check which touchscreen is in use: draglag devices lists them.",
        "The touches are turned by half a turn against the target: screen or touchscreen was turned after the "
        "calibration. Stop, calibrate the touchscreen again, and start again.",
    ],
)
def test_notices_are_dutch(dutch: None, sentence: str) -> None:
    said = in_words(sentence)
    english = {"again", "edges", "edge", "gone", "back", "turn", "device", "marked", "without", "switched"}
    assert not set(re.findall(r"[a-z]{4,}", said)) & english
    names = re.compile(r"\d+\.?\d*|/dev/\w+|enp\w+")
    assert set(names.findall(sentence)) <= set(names.findall(said))


def test_several_faults_reported_together_are_all_translated(dutch: None) -> None:
    touch = DeviceError(ADDRESS, "there is no such device", "plug it in; draglag devices lists what is there")
    laser = DeviceError("ethercat:eno1", "the network interface eno1 is switched off", "run: sudo ip link set eno1 up")
    said = in_words(str(OpenFaults((touch, laser))))
    assert said == (
        f"{ADDRESS}: dit apparaat is er niet; sluit het aan; Apparaten zoeken toont wat er is. "
        "ethercat:eno1: de netwerkinterface eno1 staat uit; voer uit: sudo ip link set eno1 up."
    )


def test_english_stays_as_the_driver_said_it(qapp: QApplication) -> None:
    for problem, remedy in faults():
        sentence = str(DeviceError(ADDRESS, problem, remedy))
        assert in_words(sentence) == sentence or "draglag devices" in remedy  # said with a button
    assert fault_words("evdev:x: it was unplugged (gone).", "plug it in again.") == (
        "evdev:x: it was unplugged (gone); plug it in again."
    )
    assert (source_name("touch"), source_name(ADDRESS)) == ("touchscreen", ADDRESS)


def test_a_device_that_is_lost_is_reported_in_dutch(open_window: Callable[..., OperatorWindow], dutch: None) -> None:
    window = open_window(language="nl")
    error = DeviceError("serial:/dev/ttyACM0", "the WALT was unplugged (hung up)", "plug it in again")
    window.space.bridge.device_fault.emit(events.DeviceFault("walt", error.source, error.problem, error.remedy))
    wanted = "serial:/dev/ttyACM0: de WALT is losgekoppeld (verbinding verbroken); sluit het weer aan."
    assert window.notice_text.text() == wanted
    assert window.header.lights["walt"].toolTip() == wanted
    log = window.pages["log"][1].table
    assert log.item(log.rowCount() - 1, 3).text() == wanted


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


@pytest.mark.parametrize(
    ("said", "dutch_words"),
    [
        ("network interface eno1: has the address 10.0.0.4", "netwerkinterface eno1: heeft het adres 10.0.0.4"),
        ("network interface eno1: belongs to br0", "netwerkinterface eno1: hoort bij br0"),
        ("network interface wlan0: is wireless", "netwerkinterface wlan0: is draadloos"),
        (
            "to look there: draglag devices --probe eno1",
            "voer om daar te zoeken ethercat:eno1 in als lasersensor en kies Opstelling controleren",
        ),
        (
            "EtherCAT bus on eno1, 2 devices, not an EK1101 with an EL1252: vendor 0x2 product 0x1",
            "EtherCAT-bus op eno1, 2 apparaten, geen EK1101 met een EL1252: vendor 0x2 product 0x1",
        ),
        ("EtherCAT bus on eno1, 3 devices, 2 of them EL1252", "EtherCAT-bus op eno1, 3 apparaten, waarvan 2 EL1252"),
        (
            "network interface eno1: the EtherCAT helper failed (exit 2)",
            "netwerkinterface eno1: het EtherCAT-hulpprogramma mislukte (exit 2)",
        ),
        (
            "install the helper again: sudo ./run install eth1",
            "installeer het hulpprogramma opnieuw: sudo ./run install eth1",
        ),
    ],
)
def test_what_a_look_around_finds_is_dutch(dutch: None, said: str, dutch_words: str) -> None:
    assert in_words(said) == dutch_words


def test_what_instruments_say_of_themselves_is_dutch(dutch: None) -> None:
    for source in make_rig(dict.fromkeys(ROLES, "sim:"), "screen-1", fast=True).sources:
        info = source.open()
        source.close()
        assert in_words(info.description) == f"gesimuleerd: {source_name(source.role)}, screen-1"
        assert in_words(info.clock) != info.clock
    assert in_words("EK1100, EL1252 on enp3s0, channel 1") == "EK1100, EL1252 aan enp3s0, kanaal 1"
    assert in_words("a touchscreen of some maker") == "a touchscreen of some maker"


def test_flags_of_runs_are_named_as_in_the_table_and_sentences_end() -> None:
    said = sentences(("run-03: no latency (off_speed, few_edges)", "Too few runs. Record runs at more speeds."))
    assert said == "run-03: no latency (off speed, few edges). Too few runs. Record runs at more speeds."
