"""A protocol as TOML text that ``load_protocol`` reads again."""

from __future__ import annotations

import tomli_w

from draglag.protocol.runs import Protocol


def to_toml(protocol: Protocol) -> str:
    """The text; defaults are left out, so that it stays short."""
    table = protocol.model_dump(mode="json", exclude_none=True, exclude_defaults=True, exclude={"source"})
    return tomli_w.dumps(table)
