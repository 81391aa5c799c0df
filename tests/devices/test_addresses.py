import sys

import pytest

from draglag_devices import discovery
from draglag_devices.addresses import KNOWN_FORMS, parse_address
from draglag_devices.opening import open_source
from draglag_devices.rig import make_rig
from draglag_devices.source import DeviceError


@pytest.mark.parametrize(
    ("text", "scheme", "target", "options"),
    [
        ("sim:", "sim", "", {}),
        ("sim:?speed=fast&seed=3", "sim", "", {"speed": "fast", "seed": "3"}),
        ("replay:some dir/session.h5", "replay", "some dir/session.h5", {}),
        ("evdev:/dev/input/event7", "evdev", "/dev/input/event7", {}),
        ("ethercat:eth1?channel=1", "ethercat", "eth1", {"channel": "1"}),
        ("serial:/dev/ttyACM0?role=laser", "serial", "/dev/ttyACM0", {"role": "laser"}),
        ("csv:edges.csv.gz", "csv", "edges.csv.gz", {}),
    ],
)
def test_every_form_is_understood(text, scheme, target, options):
    address = parse_address(text)
    assert (address.scheme, address.target, dict(address.options)) == (scheme, target, options)


@pytest.mark.parametrize("text", ["", "sim", "usb:3", "/dev/input/event3", "SIM:"])
def test_anything_else_is_refused_with_the_known_forms(text):
    with pytest.raises(DeviceError) as caught:
        parse_address(text)
    assert all(form in caught.value.remedy for form in KNOWN_FORMS)


@pytest.mark.parametrize("text", ["evdev:", "replay:?speed=fast", "sim:screen-1", "sim:?seed"])
def test_half_an_address_is_refused(text):
    with pytest.raises(DeviceError):
        parse_address(text)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("ethercat:", "ethercat: the address names no network interface; write ethercat:IFACE?channel=1."),
        ("ethercat::eth1", "ethercat::eth1: the address has one colon too many; write ethercat:eth1."),
    ],
)
def test_one_colon_follows_the_scheme(text, sentence):
    with pytest.raises(DeviceError) as caught:
        parse_address(text)
    assert str(caught.value) == sentence


def test_a_scheme_serves_only_its_roles():
    with pytest.raises(DeviceError, match="cannot serve as laser"):
        open_source("evdev:/dev/input/event0", "laser")
    with pytest.raises(DeviceError, match="cannot serve as walt"):
        open_source("csv:a.csv", "walt")


def test_a_missing_driver_is_said_and_never_replaced_by_the_simulator(monkeypatch):
    monkeypatch.setattr("draglag_devices.opening.DRIVERS", {"evdev": "draglag_devices.no_such_driver"})
    with pytest.raises(
        DeviceError, match=r"^evdev:/dev/input/event0: the driver of evdev devices is not in this version;"
    ):
        open_source("evdev:/dev/input/event0", "touch")


def test_a_driver_whose_library_is_missing_names_the_library(monkeypatch, tmp_path):
    (tmp_path / "driver_without_library.py").write_text("import a_library_nobody_has\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("draglag_devices.opening.DRIVERS", {"evdev": "driver_without_library"})
    monkeypatch.setattr(discovery, "DRIVERS", {"evdev": "driver_without_library"})
    with pytest.raises(DeviceError, match="a_library_nobody_has"):
        open_source("evdev:/dev/input/event0", "touch")
    sys.modules.pop("driver_without_library", None)
    lame = [found for found in discovery.discover() if not found.usable]
    assert [found.remedy for found in lame] == ["install draglag again"]


def test_a_missing_library_is_named_as_its_package_is_called(monkeypatch):
    for module in [name for name in sys.modules if name.startswith("draglag_devices.walt")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "serial", None)
    monkeypatch.setitem(sys.modules, "serial.tools", None)
    with pytest.raises(DeviceError) as caught:
        open_source("serial:/dev/ttyACM0", "walt")
    words = 'the Python package pyserial (extra devices) is not installed; run: pip install "draglag[devices]".'
    assert str(caught.value) == f"serial:/dev/ttyACM0: {words}"
    listed = next(found for found in discovery.discover() if found.address.startswith("serial:"))
    assert f"{listed.description}; {listed.remedy}." == words


def test_the_simulator_is_always_there():
    assert discovery.discover()[0].address == "sim:"


@pytest.mark.parametrize(
    ("addresses", "fast", "words"),
    [
        ({"touch": "sim:?seed=1", "laser": "sim:?seed=2"}, True, "differ in seed"),
        ({"touch": "sim:?seed=x"}, True, "seed"),
        ({"touch": "sim:?sped=fast"}, None, "option sped is unknown"),
        ({"touch": "sim:?speed=slow"}, None, "speed=slow is unknown"),
        ({"touch": "sim:?speed=fast", "laser": "sim:?speed=real"}, None, "real time"),
        ({"touch": "evdev:/dev/input/event0", "laser": "sim:"}, True, "faster than time"),
    ],
)
def test_contradictions_between_addresses_are_refused(addresses, fast, words):
    with pytest.raises(DeviceError, match=words):
        make_rig(addresses, fast=fast)


def test_simulated_sources_of_a_rig_share_one_world_and_two_rigs_do_not():
    one = make_rig({"touch": "sim:", "laser": "sim:"}, fast=True)
    other = make_rig({"touch": "sim:", "laser": "sim:"}, fast=True)
    assert len(one.stage.players) == 1
    assert one.stage.players["sim"] is not other.stage.players["sim"]
