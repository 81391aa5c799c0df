"""By hand: ``python -m emulators.ethercat run [NAME]``, then orders such as ``unplug`` or ``late next=16 ns=3e7``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from .netns import start_segment, why_not
from .serve import serve


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m emulators.ethercat", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="namespace, cable and slaves; orders from the keyboard")
    run.add_argument("name", nargs="?", default="ecat")
    serving = commands.add_parser("serve", help="only the slaves, on an interface that is there")
    serving.add_argument("interface")
    serving.add_argument("--control", type=Path, required=True)
    arguments = parser.parse_args()
    if arguments.command == "serve":
        serve(arguments.interface, arguments.control)
        return 0
    reason = why_not()
    if reason:
        print(reason, file=sys.stderr)
        return 1
    with start_segment(arguments.name) as segment:
        print(f"ethercat:{segment.iface}?channel=1")
        print("orders: loss share=0.01 · late next=16 ns=30000000 · unplug · plug · power which=all · al_error ·")
        print("        link up=0 · link up=1 · blink · heal · log; Ctrl-D ends")
        for text in sys.stdin:
            words = text.split()
            if not words:
                continue
            if words[0] == "blink":
                words, options = ["edges"], _blink()
            else:
                options = dict(_option(word) for word in words[1:])
            try:
                print(json.dumps(segment.order(words[0], **options)))
            except ValueError as error:
                print(error)
    return 0


def _option(word: str) -> tuple[str, Any]:
    name, _, value = word.partition("=")
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        return name, value


def _blink() -> dict[str, Any]:
    """Channel 1 dark for 5 ms every 100 ms, ten times."""
    edges = [[k * 100_000_000 + (0 if level == 0 else 5_000_000), 1, level] for k in range(10) for level in (0, 1)]
    return {"edges": edges, "relative": True}


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(0)
