"""A segment on the far end of a veth pair in a network namespace of its own, made and removed in one go."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_TESTS = Path(__file__).resolve().parents[2]
# Longer than any machine takes: a process that has raw sockets ends when the kernel finds the time to unbind them, and
# an answer that is not awaited would be taken for that to the next order.
_PATIENCE_S = 60.0


def why_not() -> str:
    """Why no segment can run here, or an empty string. Tests skip with it."""
    if shutil.which("ip") is None:
        return "the command ip (iproute2) is missing"
    if os.geteuid() != 0:
        return "network namespaces and raw sockets need root"
    name = f"dl-try{os.getpid()}"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True, check=False)
    if made.returncode:
        return f"no network namespace can be made here: {made.stderr.strip()}"
    pair = ["ip", "-n", name, "link", "add", "dl-a", "type", "veth", "peer", "name", "dl-b"]
    veth = subprocess.run(pair, capture_output=True, text=True, check=False)
    subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
    return f"no veth pair can be made here: {veth.stderr.strip()}" if veth.returncode else ""


@dataclass
class Segment:
    """A running segment.

    Attributes:
        iface: the master's end of the cable.
        control: path of the datagram socket for orders (see ``segment.Line``: one ``_do_…`` each).
    """

    iface: str
    control: Path
    namespace: str
    _process: subprocess.Popen[bytes]
    _folder: Path
    _client: socket.socket = field(init=False)

    def __post_init__(self) -> None:
        self._client = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._client.bind(str(self._folder / f"client-{os.getpid()}"))
        self._client.settimeout(_PATIENCE_S)

    def order(self, do: str, **options: Any) -> dict[str, Any]:
        """Give an order and wait until it is done. Raises ValueError with the segment's complaint."""
        self._client.sendto(json.dumps({"do": do, **options}).encode(), str(self.control))
        reply: dict[str, Any] = json.loads(self._client.recv(1 << 22))
        if "error" in reply:
            raise ValueError(reply["error"])
        return reply

    def edges(self, edges: list[tuple[int, int, int]], relative: bool = False, terminal: int = 0) -> int:
        """The host time, ns, that coming edges count from: (ns of CLOCK_MONOTONIC, channel, level), or ns from now.

        ``terminal``: of which EL1252, where there are several (0: the usual one).
        """
        base = 0
        for first in range(0, len(edges), 500):
            chunk = edges[first : first + 500]
            if relative and first:
                chunk = [(at + base, channel, level) for at, channel, level in chunk]
            base = self.order("edges", edges=chunk, relative=relative and not first, terminal=terminal)["t_ns"] or base
        return base

    def close(self) -> None:
        """End the process, remove namespace, cable and files. Twice does no harm."""
        if self._process.poll() is None:
            self._process.terminate()
        self._process.wait(_PATIENCE_S)
        self._client.close()
        # Deleting one end removes the pair, even while something still holds the namespace.
        _ip("link", "del", self.iface, check=False)
        _ip("netns", "del", self.namespace, check=False)
        shutil.rmtree(self._folder, ignore_errors=True)

    def __enter__(self) -> Segment:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def start_segment(name: str) -> Segment:
    """Slaves running in a new namespace ``dl-<name>`` at a cable ``dl-<name>``. ``name``: up to 8 characters.

    Names in use (another run, a killed one) get a number: dl-<name>2 … Raises RuntimeError where it cannot be done.
    """
    if not name or len(name) > 8:
        raise RuntimeError(f"{name!r}: a segment's name has 1 to 8 characters")
    namespace = near = _free_namespace(f"dl-{name}")
    far = f"{near}-s"
    folder = Path(tempfile.mkdtemp(prefix="dl-ecat-"))
    process: subprocess.Popen[bytes] | None = None
    try:
        _ip("link", "add", near, "type", "veth", "peer", "name", far, "netns", namespace)
        # Neither side shall chatter (IPv6 neighbour discovery) on a cable that is a field bus.
        for command in (("sysctl", "-qw", f"net.ipv6.conf.{near}.disable_ipv6=1"),
                        ("ip", "netns", "exec", namespace, "sysctl", "-qw",
                         f"net.ipv6.conf.{far}.disable_ipv6=1")):  # fmt: skip
            subprocess.run(command, capture_output=True, check=False)
        _ip("-n", namespace, "link", "set", far, "up")
        _ip("link", "set", near, "up")
        control = folder / "control"
        command = ["ip", "netns", "exec", namespace, sys.executable, "-m", "emulators.ethercat", "serve", far,
                   "--control", str(control)]  # fmt: skip
        environment = {**os.environ, "PYTHONPATH": str(_TESTS)}
        process = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL)
        _wait_for(control, process)
        return Segment(near, control, namespace, process, folder)
    except BaseException:
        if process is not None:
            process.terminate()
            process.wait(_PATIENCE_S)
        _ip("link", "del", near, check=False)
        _ip("netns", "del", namespace, check=False)
        shutil.rmtree(folder, ignore_errors=True)
        raise


@contextlib.contextmanager
def running_segment(name: str) -> Iterator[Segment]:
    """A segment for the length of a with statement."""
    segment = start_segment(name)
    try:
        yield segment
    finally:
        segment.close()


def _free_namespace(wanted: str) -> str:
    """Add a namespace named ``wanted``, or ``wanted`` and a number. Its name is free as an interface's, too."""
    for number in ("", *range(2, 100)):
        name = f"{wanted}{number}"
        if (Path("/sys/class/net") / name).exists():
            continue
        added = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True, check=False)
        if not added.returncode:
            return name
        if "File exists" not in added.stderr:
            raise RuntimeError(f"ip netns add {name}: {added.stderr.strip()}")
    raise RuntimeError(f"{wanted} to {wanted}99 are all taken: see ip netns list")


def _wait_for(control: Path, process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + _PATIENCE_S
    while not control.exists():
        if process.poll() is not None:
            raise RuntimeError(f"the segment ended with code {process.returncode}")
        if time.monotonic() > until:
            raise RuntimeError("the segment did not start")
        time.sleep(0.005)


def _ip(*arguments: str, check: bool = True) -> None:
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if check and done.returncode:
        raise RuntimeError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")
