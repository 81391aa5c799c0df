"""A protocol as TOML."""

from __future__ import annotations

import tomli_w

from draglag.protocol.runs import Protocol


def to_toml(protocol: Protocol) -> str:
    """The TOML for ``load_protocol``, without defaults."""
    table = protocol.model_dump(mode="json", exclude_none=True, exclude_defaults=True, exclude={"source"})
    return tomli_w.dumps(table)
