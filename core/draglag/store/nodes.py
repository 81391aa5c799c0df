"""Nodes merged, split, or given separate groups."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from draglag.store.schema import Node, Table, Value


def separate(node: Node, owners: dict[str, Value]) -> Node:
    """The node, in its own group where two streams give one group name."""
    stream, path, number = node.attrs.get("stream"), node.path, 2
    if stream is None:
        return node
    while owners.setdefault(path, stream) != stream:
        path, number = f"{node.path}-{number}", number + 1
    return replace(node, path=path)


def merged(nodes: Iterable[Node]) -> list[Node]:
    """One node per group: the last attributes, summed counters, concatenated rows."""
    by_path: dict[str, list[Node]] = {}
    for node in nodes:
        by_path.setdefault(node.path, []).append(node)
    return [_join(same) for same in by_path.values()]


def row_count(node: Node) -> int:
    """Rows that a node adds to its table."""
    return max((len(values) for values in node.rows.values()), default=0)


def pieces(node: Node, limit: int) -> Iterator[Node]:
    """Pieces of at most ``limit`` rows; attributes and counters go with the first."""
    yield replace(node, rows={name: values[:limit] for name, values in node.rows.items()})
    for start in range(limit, row_count(node), limit):
        rows = {name: values[start : start + limit] for name, values in node.rows.items()}
        yield Node(node.path, table=node.table, rows=rows)


def _join(nodes: list[Node]) -> Node:
    if len(nodes) == 1:
        return nodes[0]
    attrs: dict[str, Value] = {}
    texts: dict[str, str] = {}
    counts: dict[str, int] = {}
    for node in nodes:
        attrs.update(node.attrs)
        texts.update(node.texts)
        for key, value in node.counts.items():
            counts[key] = counts.get(key, 0) + value
    table = next((node.table for node in nodes if node.table is not None), None)
    rows = {} if table is None else _join_rows(table, nodes)
    return Node(nodes[0].path, attrs, counts, texts, table, rows)


def _join_rows(table: Table, nodes: list[Node]) -> dict[str, Any]:
    lengths = [row_count(node) for node in nodes]
    joined = {}
    for column in table.every():
        columns = [node.rows.get(column.name, ()) for node in nodes]
        if any(len(values) for values in columns):
            filled = [
                values if len(values) else np.full(length, column.fill, column.dtype)
                for values, length in zip(columns, lengths, strict=True)
            ]
            joined[column.name] = np.concatenate(filled)
    return joined
