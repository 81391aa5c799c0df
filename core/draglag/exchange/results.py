"""Stored results next to exported raw data."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

from draglag.store.analysis import StoredAnalysis, flat_record

TABLE_FILE = "results.csv"
JSON_FILE = "results.json"
_ABOUT = ("analysis", "created_utc", "software", "up_to_date")


def write_results(place: Path, results: Sequence[StoredAnalysis]) -> None:
    """Write ``results.csv`` (a row per analysis and run) and ``results.json`` (as ``draglag analyze --json``)."""
    if not results:
        return
    rows = [
        dict(zip(_ABOUT, (one.number, one.created_utc, one.software, int(one.up_to_date)), strict=True)) | cells
        for one in results
        for cells in map(flat_record, one.result.get("runs", ()))
    ]
    columns = list(dict.fromkeys([*_ABOUT, *(key for row in rows for key in row)]))
    with (place / TABLE_FILE).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    whole = [
        {
            "analysis": one.number,
            "created_utc": one.created_utc,
            "software": one.software,
            "up_to_date": one.up_to_date,
            "input_sha256": one.input_sha256,
            "options": one.options,
            "result": one.result,
        }
        for one in results
    ]
    (place / JSON_FILE).write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n", "utf-8")
