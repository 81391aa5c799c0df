"""A serial port, read without blocking."""

from __future__ import annotations

import errno
import os
import select
from typing import Protocol

import serial
from serial.tools import list_ports

from draglag.messages import message
from draglag_devices.source import DeviceError
from draglag_devices.walt.protocol import BAUD

RIGHTS_REMEDY = message(
    "as administrator, add yourself to the group that owns it (sudo usermod -aG dialout $USER), log out and in again, "
    "or install the udev rules of draglag"
)
_WRITE_TIMEOUT_S = 1.0


class PortGone(Exception):
    """The port has disappeared."""


class Port(Protocol):
    """A port as the link needs it."""

    def write(self, data: bytes) -> None: ...

    def read(self, timeout_s: float) -> bytes:
        """Bytes, or b"" after ``timeout_s``. Raises PortGone."""
        ...

    def close(self) -> None: ...


class SerialPort:
    """A tty, locked exclusively."""

    def __init__(self, path: str) -> None:
        """Raises DeviceError."""
        address = f"serial:{path}"
        if not os.path.exists(path):
            raise DeviceError(address, "there is no such port", _other_ports(path))
        try:
            self._serial = serial.Serial(path, BAUD, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True)
        except serial.SerialException as error:
            raise _refusal(address, path, error) from None
        except (ValueError, OSError) as error:
            raise DeviceError(
                address, message("cannot be used as a serial port ({why})", why=error), "check the address"
            ) from None
        self._fd: int = self._serial.fileno()

    def write(self, data: bytes) -> None:
        try:
            while data:
                data = data[os.write(self._fd, data) :]
        except BlockingIOError:
            raise PortGone(message("it takes no more bytes")) from None
        except OSError as error:
            raise PortGone(os.strerror(error.errno or errno.EIO)) from None

    def read(self, timeout_s: float) -> bytes:
        try:
            ready, _, _ = select.select([self._fd], [], [], max(0.0, timeout_s))
            if not ready:
                return b""
            data = os.read(self._fd, 4096)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise PortGone(str(error)) from None
        if not data:
            raise PortGone(message("hung up"))
        return data

    def close(self) -> None:
        try:
            self._serial.close()
        except (OSError, serial.SerialException):
            return  # an unplugged port cannot be closed any better


def usb_identity(path: str) -> tuple[int, int, str] | None:
    """Vendor, product and serial number behind a port."""
    for port in list_ports.comports():
        if port.device == os.path.realpath(path) and port.vid is not None and port.serial_number:
            return port.vid, port.pid, port.serial_number
    return None


def port_of(identity: tuple[int, int, str] | None, path: str) -> str:
    """A device's port, which may change on replugging, else ``path``."""
    if identity is None or os.path.exists(path):
        return path
    for port in list_ports.comports():
        if (port.vid, port.pid, port.serial_number) == identity:
            return str(port.device)
    return path


def _refusal(address: str, path: str, error: serial.SerialException) -> DeviceError:
    code = error.errno
    text = str(error)
    if code == errno.EACCES or not os.access(path, os.R_OK | os.W_OK):
        return DeviceError(address, "you have no rights to this port", RIGHTS_REMEDY)
    if code == errno.EBUSY or "exclusively lock" in text:
        return DeviceError(
            address, "another program uses this port", message("close it (see: {command})", command=f"fuser -v {path}")
        )
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return DeviceError(address, "there is no device behind this port", "plug the WALT in again")
    return DeviceError(address, message("cannot be opened ({why})", why=text), "check that it is a serial port")


def _other_ports(path: str) -> str:
    others = [port.device for port in list_ports.comports() if port.vid is not None and port.device != path]
    if others:
        return message("plug the WALT in, or use one of: {ports}", ports=", ".join(others))
    return message("plug the WALT in; it appears as /dev/ttyACM0 or similar (draglag devices lists it)")
