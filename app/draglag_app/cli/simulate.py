"""``draglag simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from draglag_app.cli.common import Seed, progress, refuse_existing, warn

if TYPE_CHECKING:
    from draglag.simulation.effects import Effect
    from draglag.simulation.rig import Rig


class _ListsEffects(click.Command):
    """Lists every effect after its help."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from draglag.simulation.effects import EFFECTS

        rows = []
        for name, effect in EFFECTS.items():
            sizes = (f"{p.name} {p.typical:g} {p.unit if p.unit != '1' else ''}".rstrip() for p in effect.parameters)
            rows.append((name, ", ".join(sizes)))
        with formatter.section("Effects and typical sizes (ID alone; ID=VALUE; ID=VALUE,NAME=VALUE)"):
            formatter.write_dl(rows)


@click.command("simulate", cls=_ListsEffects)
@click.option("--screen", "screen_name", required=True, metavar="NAME", help="Preset or TOML file of the screen.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="ID=VALUE",
    help="A physical effect and its size; may be given several times.",
)
@click.option(
    "--model",
    "model_path",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Law and effects of a latency model instead of the screen's law.",
)
@click.option("--seed", type=Seed(), default=0, show_default=True, help="Makes the session repeatable.")
@click.option(
    "--protocol", default="demo", show_default=True, metavar="NAME", help="Preset or TOML file of the protocol."
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="The session file to make.")
def simulate(
    screen_name: str, effects: tuple[str, ...], model_path: Path | None, seed: int, protocol: str, out: Path
) -> None:
    """Simulate a whole session on a screen and write it like a measured one.

    \b
    Examples:
        draglag simulate --screen screen-1 --out session.h5
        draglag simulate --screen screen-2 --effect clock_drift=60 --effect low_speed_plateau=118 \\
            --seed 7 --out drift.h5
        draglag simulate --screen screen-2 --model extended.json --out again.h5
    """
    from draglag.simulation.chain import simulate_session
    from draglag.simulation.effects import parse_effects
    from draglag.store import write_session

    refuse_existing(out)
    chosen = parse_effects(effects)
    screen: str | Rig = screen_name
    words = ""
    if model_path is not None:
        screen, chosen, words = _of_model(screen_name, model_path, chosen)
    with progress("Simulating"):
        session = simulate_session(screen, protocol, effects=chosen, seed=seed)
    write_session(session, out)
    click.echo(f"{out}: {len(session.runs)} runs of {session.screen.name}{words}")


def _of_model(screen_name: str, path: Path, chosen: tuple[Effect, ...]) -> tuple[Rig, tuple[Effect, ...], str]:
    from draglag.gap.correction import realise, size_words
    from draglag.gap.replaying.realised import rig_with_law
    from draglag.model.file import left_unexplained, load_model
    from draglag.simulation.rig import rig_for_screen

    model = load_model(path)
    named = [effect for effect in model.effects if effect.id not in {e.id for e in chosen}]
    own = {effect.id: realise(effect) for effect in model.effects}
    added = [own[effect.id] for effect in named]
    rig, plateau = rig_with_law(rig_for_screen(screen_name), model.form, model.parameters, tuple(own.values()))
    if plateau is not None and not any(e.id == plateau.id for e in (*chosen, *added)):
        added.append(plateau)
    warn(left_unexplained(model))
    words = f", with the law of {model.provenance.session or path}"
    if named:
        words += " and " + "; ".join(size_words(effect) for effect in named)
    replaced = [effect for effect in model.effects if effect not in named]
    if replaced:
        words += f"; {', '.join(effect.id for effect in replaced)} as given by hand"
    return rig, (*chosen, *added), words
