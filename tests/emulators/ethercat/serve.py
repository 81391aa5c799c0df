"""The process behind a segment: raw frames on one side, a control socket on the other, one loop."""

from __future__ import annotations

import fcntl
import json
import os
import select
import socket
import struct
import time
from pathlib import Path

from .frames import ETHERTYPE
from .segment import Line

_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 0x1
_OUTGOING = 4  # PACKET_OUTGOING


def set_link(interface: str, up: bool) -> None:
    """Switch an interface of this namespace on or off: the other end of the cable sees its carrier go."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        name = interface.encode().ljust(16, b"\0")
        flags = struct.unpack_from("<H", fcntl.ioctl(control, _SIOCGIFFLAGS, name + bytes(16)), 16)[0]
        flags = flags | _IFF_UP if up else flags & ~_IFF_UP
        fcntl.ioctl(control, _SIOCSIFFLAGS, name + struct.pack("<H14x", flags))


def serve(interface: str, control: Path, line: Line | None = None) -> None:
    """Answer frames on ``interface`` until the control socket says ``stop`` or this process's parent is gone."""
    line = line or Line(time.monotonic_ns())
    wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
    wire.bind((interface, ETHERTYPE))
    wire.setblocking(False)
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listening.bind(str(control))
    parent = os.getppid()
    try:
        while os.getppid() == parent:
            due = line.next_due_ns()
            wait_s = 0.5 if due is None else min(0.5, max(0.0, (due - time.monotonic_ns()) / 1e9))
            ready, _, _ = select.select([wire, listening], [], [], wait_s)
            if listening in ready and not _control(listening, line, interface):
                return
            if wire in ready:
                _frames(wire, line)
            for reply in line.due(time.monotonic_ns()):
                _send(wire, reply)
    finally:
        wire.close()
        listening.close()
        control.unlink(missing_ok=True)


def _frames(wire: socket.socket, line: Line) -> None:
    for _ in range(64):
        try:
            frame, sender = wire.recvfrom(2048)
        except (BlockingIOError, OSError):  # ENETDOWN while the link is off
            return
        if sender[2] == _OUTGOING:
            continue
        reply = line.take(frame, time.monotonic_ns())
        if reply is not None:
            _send(wire, reply)


def _send(wire: socket.socket, frame: bytes) -> None:
    try:
        wire.send(frame)
    except OSError:
        return  # the link is off: the frame is lost, as it would be


def _control(listening: socket.socket, line: Line, interface: str) -> bool:
    """One order; False ends the process."""
    message, sender = listening.recvfrom(1 << 20)
    try:
        order = json.loads(message)
        if order["do"] == "link":
            set_link(interface, bool(order["up"]))
            reply = {}
        elif order["do"] == "stop":
            reply = {}
        else:
            reply = line.obey(order, time.monotonic_ns())
    except (KeyError, TypeError, ValueError, OSError) as error:
        order, reply = {"do": ""}, {"error": f"{type(error).__name__}: {error}"}
    if sender:
        listening.sendto(json.dumps(reply).encode(), sender)
    return bool(order["do"] != "stop")
