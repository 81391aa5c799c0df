"""The process that runs the bus: ``python -m draglag_devices.ethercat_laser.master IFACE --channel 1``.

Only it needs CAP_NET_RAW and CAP_NET_ADMIN. A child (``keeper``) exchanges frames at 1 kHz (``runner``) and writes
messages (``wire``) until standard input closes. Times: ns of CLOCK_MONOTONIC; DC times: ns since 2000-01-01.
"""

from __future__ import annotations

import argparse
import gc
import signal
import sys

from draglag.messages import message
from draglag_devices.ethercat_laser import preflight
from draglag_devices.ethercat_laser.keeper import Crashed, Keeper
from draglag_devices.ethercat_laser.refusal import Refusal
from draglag_devices.ethercat_laser.waits import INHERIT_S
from draglag_devices.ethercat_laser.wire import ReaderGone, Wire


def serve(interface: str, channel: int, wire: Wire, first_epoch: int = 0, position: int = 0) -> int:
    """Run the bus: 0 when the reader went, 1 after a refusal or crash."""
    lock = None
    try:
        if first_epoch == 0:
            preflight.check_interface(interface)
        preflight.check_rights(interface)
        # After a crash of an earlier process it may take a moment until it has let go of everything.
        lock = preflight.claim(interface, 0.0 if first_epoch == 0 else INHERIT_S)
        try:
            from draglag_devices.ethercat_laser.runner import live
        except ModuleNotFoundError as missing:
            from draglag.system.packages import advice

            raise Refusal("no_pysoem", *advice(missing.name or "")) from None

        def life(number: int, child_wire: Wire) -> None:
            live(interface, channel, position, number, child_wire)

        gc.freeze()
        Keeper(interface, wire, life, first_epoch).run()
    except Refusal as refusal:
        wire.send("refused", code=refusal.code, problem=refusal.problem, remedy=refusal.remedy)
        return 1
    except Crashed:
        return 1
    except ReaderGone:
        return 0
    finally:
        if lock is not None:
            lock.close()


def check(wire: Wire) -> int:
    """Report what an installation lacks, without touching an interface: 0 if nothing."""
    try:
        preflight.check_rights("")
        import draglag_devices.ethercat_laser.runner  # noqa: F401  (with pysoem)
    except ModuleNotFoundError as missing:
        wire.send(
            "refused",
            code="no_pysoem",
            problem=message("there is no {module}", module=missing.name),
            remedy=message("install draglag again"),
        )
        return 1
    except Refusal as refusal:
        wire.send("refused", code=refusal.code, problem=refusal.problem, remedy=refusal.remedy)
        return 1
    wire.send("complete")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="draglag-ethercat-master", description="EtherCAT bus of the laser sensor")
    parser.add_argument("interface", nargs="*", help="one, to run its bus; with --probe: more to ask")
    parser.add_argument("--channel", type=int, choices=(1, 2), default=1)
    parser.add_argument("--position", type=int, default=0, help="of the EL1252 on the line, where there are several")
    parser.add_argument("--first-epoch", type=int, default=0)
    parser.add_argument("--probe", action="store_true", help="ask once on which interfaces devices answer")
    parser.add_argument("--only", help="interfaces that may be opened, with commas between; any if left out")
    parser.add_argument("--check", action="store_true", help="say whether all that a bus needs is installed")
    arguments = parser.parse_args()
    # Ctrl-C belongs to the program that started us: it closes our input when it is done.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def stop(*_: object) -> None:
        raise ReaderGone

    signal.signal(signal.SIGTERM, stop)
    wire = Wire(sys.stdin.fileno(), sys.stdout.fileno())
    only = None if arguments.only is None else arguments.only.split(",")
    try:
        if arguments.check:
            return check(wire)
        if arguments.probe:
            from draglag_devices.ethercat_laser.probe import scan_bus

            wire.send("probed", found=scan_bus(arguments.interface, only=only))
            return 0
        if len(arguments.interface) != 1:
            parser.error("name one interface")
        if only is not None and arguments.interface[0] not in only:
            parser.error("that interface is not allowed")
        return serve(arguments.interface[0], arguments.channel, wire, arguments.first_epoch, arguments.position)
    except ReaderGone:
        return 0


if __name__ == "__main__":
    sys.exit(main())
