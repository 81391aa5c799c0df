"""Curves of several sessions next to each other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from draglag.shown import chance
from draglag_app.windows.window import OperatorWindow


class TestCompare:
    def test_sessions_appear_in_table_and_plots(
        self, opened: OperatorWindow, until: Callable, session_file: Path
    ) -> None:
        page = opened.pages["compare"][1]
        page._add_present()
        page.add_files([session_file])
        until(lambda: page.table.rowCount() == 2)
        # Two sessions of one name are distinguished by their files.
        assert page.table.item(1, 0).text().endswith(f"({session_file.name})")
        apart = next(columns for name, columns in page.apart.drawn.items() if name.startswith("2") and "95" not in name)
        assert np.abs(apart[1]).max() < 1e-9  # the same session twice
        assert page.table.item(1, page.table.columnCount() - 1).text().startswith("no")

    def test_what_is_chosen_can_be_taken_away(self, opened: OperatorWindow) -> None:
        page = opened.pages["compare"][1]
        assert not page.remove_button.isEnabled()
        page._add_present()
        assert not page.remove_button.isEnabled()
        page.table.selectRow(0)
        page.remove_button.click()
        assert page.table.rowCount() == 0
        assert not page.remove_button.isEnabled()

    def test_no_chance_is_nothing(self) -> None:
        assert chance(0.031) == "p = 0.031"
        assert chance(0.0) == "p < 0.001"
