"""Greets a WALT."""

from __future__ import annotations

from draglag.errors import message_of
from draglag.messages import message
from draglag_devices.source import DeviceError
from draglag_devices.walt.link import ANSWER_S, Answer, Link, NoAnswer
from draglag_devices.walt.port import PortGone
from draglag_devices.walt.protocol import KNOWN_VERSION, LASER_OFF, RESET, SCREEN_OFF, VERSION, parse_version

_ATTEMPTS = 3


def greet(link: Link, address: str, any_firmware: bool = False) -> str:
    """The firmware's version, with autosending off and triggers reset. Raises DeviceError, also for another version
    than 6."""
    version = _version(link, address)
    if version != KNOWN_VERSION and not any_firmware:
        raise DeviceError(
            address,
            message(
                "the WALT runs firmware {version}, and only version {known} is known to be understood",
                version=version,
                known=KNOWN_VERSION,
            ),
            message("flash firmware {version}, or try it as it is with ?firmware=any", version=KNOWN_VERSION),
        )
    try:
        for command in (LASER_OFF, SCREEN_OFF, RESET):
            _acknowledged(link, command)
    except NoAnswer:
        raise DeviceError(
            address,
            "it names a version but does not take commands as a WALT does",
            message("check that it is a WALT with firmware {version}", version=KNOWN_VERSION),
        ) from None
    except PortGone as gone:
        raise DeviceError(
            address, message("the WALT was unplugged ({why})", why=message_of(gone)), "plug it in again"
        ) from None
    link.take_triggers()
    return version


def _acknowledged(link: Link, command: str) -> None:
    for attempt in range(_ATTEMPTS):
        try:
            link.acknowledged(command)
        except NoAnswer:
            if attempt == _ATTEMPTS - 1:
                raise
        else:
            return


def _version(link: Link, address: str) -> str:
    late: Answer[str] | None = None
    try:
        link.forget()
        unread = link.unread
        for _ in range(_ATTEMPTS):
            try:
                answer = link.ask(VERSION, parse_version, late=True)
            except NoAnswer:
                continue
            if answer.arrived_s - answer.sent_s <= ANSWER_S:
                return answer.value
            late = answer
    except PortGone as gone:
        raise DeviceError(
            address, message("the WALT was unplugged ({why})", why=message_of(gone)), "plug it in again"
        ) from None
    if late is not None:
        raise DeviceError(
            address,
            message(
                "the WALT takes {seconds:.1f} s to answer, too long to compare clocks",
                seconds=late.arrived_s - late.sent_s,
            ),
            "plug it into the computer itself, without a hub, and close other programs",
        )
    if link.unread > unread:
        raise DeviceError(
            address, "what answers at this port is not a WALT", "choose another port: draglag devices lists them"
        )
    raise DeviceError(
        address, "nothing answers at this port", "check that it is the WALT's port, unplug it and plug it in again"
    )
