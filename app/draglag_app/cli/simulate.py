"""``draglag simulate``: a session of a simulated screen, without devices and without waiting."""

from __future__ import annotations

from pathlib import Path

import click

from draglag_app.cli.common import progress, refuse_existing


@click.command("simulate")
@click.option("--screen", "screen_name", required=True, metavar="NAME", help="Preset or TOML file of the screen.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="ID=VALUE",
    help="A physical effect and its size; may be given several times.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Makes the session repeatable.")
@click.option(
    "--protocol", default="demo", show_default=True, metavar="NAME", help="Preset or TOML file of the protocol."
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="The session file to make.")
def simulate(screen_name: str, effects: tuple[str, ...], seed: int, protocol: str, out: Path) -> None:
    """Simulate a whole session on a screen and write it like a measured one.

    \b
    Examples:
        draglag simulate --screen screen-1 --out session.h5
        draglag simulate --screen screen-2 --effect clock_drift=60 --effect low_speed_plateau=118 \\
            --seed 7 --out drift.h5
    """
    from draglag.simulation.chain import simulate_session
    from draglag.simulation.effects import parse_effects
    from draglag.store import write_session

    refuse_existing(out)
    chosen = parse_effects(effects)
    with progress("Simulating"):
        session = simulate_session(screen_name, protocol, effects=chosen, seed=seed)
    write_session(session, out)
    click.echo(f"{out}: {len(session.runs)} runs of {session.screen.name}")
