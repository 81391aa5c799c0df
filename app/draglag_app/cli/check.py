"""``draglag check``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from draglag.protocol.presets import load_screen_file
from draglag.recording import Screen
from draglag_app.cli.common import FiniteRange, json_option, print_json, progress
from draglag_app.preflight import Check, preflight, ready

MARKS = {"ok": "✓", "warning": "!", "fault": "✗"}


@click.command("check")
@click.option("--touch", metavar="ADDRESS", help="The touchscreen, e.g. evdev:/dev/input/event5.")
@click.option("--laser", metavar="ADDRESS", help="The laser sensor, e.g. ethercat:eth1?channel=1.")
@click.option("--walt", metavar="ADDRESS", help="The WALT, e.g. serial:/dev/ttyACM0.")
@click.option("--screen", "screen_name", metavar="NAME", help="Preset or TOML file of the screen under test.")
@click.option("--seconds", default=3.0, show_default=True, type=FiniteRange(0.5, 3600),
              help="How long to watch; longer bounds the drift of clocks more closely.")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder where sessions will be saved.")
@json_option
@click.pass_context
def check(
    ctx: click.Context,
    touch: str | None,
    laser: str | None,
    walt: str | None,
    screen_name: str | None,
    seconds: float,
    out: Path | None,
    as_json: bool,
) -> None:
    """Check that the rig is ready: draw on the screen and through the beam while it is watched.

    Exit 1 if something failed (✗); a warning (!) is for the operator to judge.

    \b
    Example:
        draglag check --touch evdev:/dev/input/event5 --laser ethercat:eth1?channel=1 --walt serial:/dev/ttyACM0
    """
    addresses = {role: text for role, text in (("touch", touch), ("laser", laser), ("walt", walt)) if text}
    if not addresses:
        raise click.UsageError("name at least one of --touch, --laser, --walt (draglag devices lists them)")
    screen = None
    if screen_name is not None:
        preset = load_screen_file(screen_name)
        screen = Screen(preset.name, **preset.screen.model_dump())
    done: list[Check] = []
    with progress("watching") as on_progress:
        for row in preflight(addresses, screen, screen_name or "screen-1", seconds, out,
                             (lambda share: on_progress(share, "")) if on_progress else None):  # fmt: skip
            done.append(row)
    if as_json:
        print_json({"ready": ready(done), "checks": [asdict(row) for row in done]})
    else:
        _print(done)
    if not ready(done):
        first = next(row for row in done if row.state == "fault")
        measured = first.measured.rstrip(".")
        click.echo(f"draglag: not ready: {first.name}: {measured}; {first.remedy or 'see the checks'}", err=True)
        ctx.exit(1)


def _print(done: list[Check]) -> None:
    width = max(len(row.name) for row in done)
    for row in done:
        click.echo(line(row, width))
    faults = sum(row.state == "fault" for row in done)
    click.echo("Ready." if ready(done) else f"Not ready: {faults} of {len(done)} checks failed.")


def line(row: Check, width: int = 0) -> str:
    """One check as a line."""
    text = f"{MARKS[row.state]} {row.name:<{width}}  {row.measured}"
    if row.limit:
        text += f"  (limit {row.limit})"
    return text + (f"  → {row.remedy}" if row.remedy else "")
