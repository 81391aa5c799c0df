"""``draglag compensate`` as tests call it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result

from draglag_app.cli import cli


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["compensate", *map(str, arguments)])


def columns(path: Path) -> dict[str, np.ndarray]:
    """Name → numbers of a table that it has written."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
