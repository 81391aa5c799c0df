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
        "is the size, and the meaning is that of a positive one. Effects of your own: [effects.md](effects.md).",
    ]
    for effect in EFFECTS.values():
        if effect.__module__.startswith("draglag."):
            lines += _section(effect)
    return "\n".join(lines) + "\n"


def _section(effect: type[Effect]) -> list[str]:
    title = title_of(effect.id)
    meaning = f"`{effect.id}`: {effect.meaning} {effect.in_detail}".rstrip()
    lines = ["", f"## {title[:1].upper()}{title[1:]}", meaning, ""]
    for p in effect.parameters:
        unit = "" if p.unit == "1" else f" {p.unit}"
        lines.append(f"- `{p.name}`: {p.lower:g} to {p.upper:g}{unit}, typically {p.typical:g}{unit}")
    if effect.follows:
        lines.append(f"- Its gap follows {followed(effect.follows)}.")
    if effect.separated_by:
        lines.append(f"- To separate it from what looks alike: {effect.separated_by}.")
    return lines
