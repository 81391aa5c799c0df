"""The page on the effects of the library."""

from __future__ import annotations

from draglag.gap.results import followed
from draglag.simulation.effects import EFFECTS, Effect, title_of


def library_page() -> str:
    """The page, Markdown: every effect of draglag itself, with what a positive size does."""
    lines = [
        "# The effects of the library",
        "",
        "<!-- Made by ./run schemas from draglag.simulation.effects. -->",
        "",
        "What `draglag gap` can name, `draglag simulate --effect ID=SIZE` adds and a model holds. The first parameter",
        "is the size; the meaning is that of a positive one, and the value in brackets is a typical one.",
        "Effects of your own: [effects.md](effects.md).",
        "",
        "| effect | meaning | parameters | its gap follows | separated by |",
        "|---|---|---|---|---|",
    ]
    own = [effect for effect in EFFECTS.values() if effect.__module__.startswith("draglag.")]
    return "\n".join([*lines, *map(_line, own)]) + "\n"


def _line(effect: type[Effect]) -> str:
    parameters = "<br>".join(
        f"`{p.name}` ({p.typical:g}{'' if p.unit == '1' else f' {p.unit}'})" for p in effect.parameters
    )
    follows = followed(effect.follows) if effect.follows else ""
    name = f"{title_of(effect.id)}<br>`{effect.id}`"
    return f"| {name} | {effect.meaning} | {parameters} | {follows} | {effect.separated_by} |"
