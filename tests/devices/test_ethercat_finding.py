"""Where EtherCAT devices are looked for, and what is said of each interface."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from devices.ethercat_rig import Recording, needs_segment
from draglag_devices.discovery import Found
from draglag_devices.ethercat_laser import finding, probe
from draglag_devices.ethercat_laser.finding import find_buses
from draglag_devices.ethercat_laser.surroundings import used_addresses
from emulators.ethercat import Segment, why_not

_WHY_NOT = why_not()
EL1008 = 0x03F03052


def of(interface: str, found: list[Found]) -> Found:
    return next(entry for entry in found if entry.address == f"ethercat:{interface}?channel=1")


def seen(**changes: Any) -> dict[str, Any]:
    """An interface with a cable, on which nothing answers."""
    return {"name": "eth1", "up": True, "carrier": True, "rights": True, "busy": False, "slaves": 0, "kinds": [],
            "left_alone": "", **changes}  # fmt: skip


def test_the_addresses_of_an_interface_are_known() -> None:
    assert used_addresses()[1] == ["127.0.0.1"]


class TestWithASegment:
    pytestmark = needs_segment

    def test_other_devices_are_a_bus_and_not_ready(self, segment: Segment) -> None:
        segment.order("identity", terminal=EL1008)
        found = of(segment.iface, find_buses())
        assert not found.usable
        kinds = "vendor 0x2 product 0x044D2C52, vendor 0x2 product 0x03F03052"
        assert f"2 devices, not an EK1101 with an EL1252: {kinds}" in found.description
        assert found.remedy.startswith("connect the EK1101")

    def test_of_several_el1252_the_address_must_say_which(self, segment: Segment) -> None:
        segment.order("identity", behind=[0x04E43052])
        found = of(segment.iface, find_buses())
        assert (found.usable, found.remedy) == (False, "say which in the laser's address: &position=2 or &position=3")

    def test_a_device_that_owns_its_eeprom_is_known_and_owns_it_afterwards(self, segment: Segment) -> None:
        segment.order("register", address=0x0500, value="01")
        assert of(segment.iface, find_buses()).usable
        assert segment.order("register", address=0x0500, length=1)["value"] == "01"

    def test_an_interface_with_an_address_is_left_alone_unless_it_is_asked_for(self, segment: Segment) -> None:
        subprocess.run(["ip", "addr", "add", "198.51.100.7/32", "dev", segment.iface], check=True)
        try:
            left, asked = (of(segment.iface, find_buses(probe)) for probe in ((), (segment.iface,)))
        finally:
            subprocess.run(["ip", "addr", "del", "198.51.100.7/32", "dev", segment.iface], check=True)
        assert not left.usable
        assert left.description == f"network interface {segment.iface}: has the address 198.51.100.7"
        assert left.remedy == f"to look there: draglag devices --probe {segment.iface}"
        assert asked.usable
        with Recording(segment) as rec:  # and the question has left nothing behind
            assert rec.info.details["level_at_start"] == 0


LISTEN = """
import json, socket
from draglag_devices.ethercat_laser.preflight import ETHERTYPE
from draglag_devices.ethercat_laser.probe import scan_bus
wires = {}
for name in ("office-s", "member-s", "field-s"):
    wires[name] = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
    wires[name].bind((name, ETHERTYPE))
    wires[name].setblocking(False)
entries = {entry["name"]: entry["left_alone"] for entry in scan_bus()}
frames = {}
for name, wire in wires.items():
    try:
        wire.recv(2048)
        frames[name] = True
    except BlockingIOError:
        frames[name] = False
print(json.dumps([entries, frames]))
"""


@pytest.fixture
def namespace() -> Iterator[str]:
    """A network of its own: an office with IPv6, a member of a bridge, a bridge, and a cable that nobody uses."""
    name = f"dl-look{os.getpid()}"
    subprocess.run(["ip", "netns", "add", name], check=True)

    def ip(*words: str) -> None:
        subprocess.run(["ip", "-n", name, *words], check=True)

    try:
        for near in ("office", "member", "field"):
            ip("link", "add", near, "type", "veth", "peer", "name", f"{near}-s")
            ip("link", "set", near, "up")
            ip("link", "set", f"{near}-s", "up")
        ip("addr", "add", "2001:db8::7/64", "dev", "office", "nodad")
        ip("link", "add", "br0", "type", "bridge")
        ip("link", "set", "member", "master", "br0")
        ip("link", "set", "br0", "up")
        yield name
    finally:
        subprocess.run(["ip", "netns", "del", name], check=False)


@pytest.mark.wire
@pytest.mark.skipif(bool(_WHY_NOT), reason=f"no namespaces here: {_WHY_NOT}")
def test_no_frame_goes_where_others_are(namespace: str) -> None:
    command = ["ip", "netns", "exec", namespace, sys.executable, "-c", LISTEN]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    left_alone, frames = json.loads(done.stdout)
    assert left_alone["office"] == "has the address 2001:db8::7"
    assert left_alone["member"] == "belongs to br0"
    assert left_alone["br0"] == "is a bridge"
    assert left_alone["field"] == ""
    assert frames == {"office-s": False, "member-s": False, "field-s": True}


def test_without_knowing_addresses_no_interface_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> dict[int, list[str]]:
        raise OSError("no netlink here")

    monkeypatch.setattr(probe, "used_addresses", refuse)
    monkeypatch.setattr(probe.socket, "if_nameindex", lambda: [(7, "eth1")])
    monkeypatch.setattr(probe, "_ethernet", lambda interface: True)
    monkeypatch.setattr(probe, "link_state", lambda interface: (1, True))
    monkeypatch.setattr(probe, "has_rights", lambda: True)
    monkeypatch.setattr(probe, "count_slaves", lambda interface: pytest.fail("a frame went out"))
    (entry,) = probe.scan_bus()
    assert (entry["left_alone"], entry["slaves"]) == ("has addresses that cannot be read", 0)


@pytest.mark.parametrize(
    ("changes", "problem", "remedy"),
    [
        ({"up": False, "carrier": False}, "switched off", "sudo ip link set eth1 up"),
        ({"carrier": False}, "no carrier", "plug in the cable"),
        ({"left_alone": "is wireless"}, "is wireless", "draglag devices --probe eth1"),
        ({}, "the EtherCAT helper failed (it has no rights)", "install the helper again"),
    ],
)
def test_a_helper_that_fails_leaves_no_interface_out(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], problem: str, remedy: str
) -> None:
    monkeypatch.setattr(finding, "command", lambda *_: [sys.executable, "-c", "raise SystemExit('it has no rights')"])
    monkeypatch.setattr(finding, "scan_bus", lambda asked, send: [seen(rights=False, **changes)])
    (found,) = find_buses()
    assert (found.address, found.usable) == ("ethercat:eth1?channel=1", False)
    assert found.description == f"network interface eth1: {problem}"
    assert remedy in found.remedy


def test_a_helper_that_cannot_be_started_says_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(finding, "command", lambda *_: [str(tmp_path / "gone")])
    monkeypatch.setattr(finding, "scan_bus", lambda asked, send: [seen()])
    (found,) = find_buses()
    assert "the EtherCAT helper failed (No such file or directory)" in found.description
