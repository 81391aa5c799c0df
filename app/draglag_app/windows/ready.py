"""What the window does with all fields, lists and buttons, those of a page as soon as it is made."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtWidgets import QWidget

from draglag_app.windows.actions import ACTIONS, keys_of
from draglag_app.windows.drops import refuse_drops
from draglag_app.windows.parts.field_keys import FieldKeys
from draglag_app.windows.parts.finger_lists import raise_rows
from draglag_app.windows.parts.finger_scroll import scroll_by_finger
from draglag_app.windows.parts.keyed_buttons import show_keys


def make_ready(root: QWidget, keys: Mapping[str, str]) -> None:
    """Prepare everything in ``root``, once; ``keys``: the chosen ones."""
    FieldKeys(root)
    raise_rows(root)
    scroll_by_finger(root)
    refuse_drops(root)
    if keys:
        show_chosen_keys(root, keys)


def show_chosen_keys(root: QWidget, chosen: Mapping[str, str]) -> None:
    """Show these keys on buttons instead of the usual ones."""
    usual, present = ({spec.id: keys_of(spec.id, which) for spec in ACTIONS} for which in ({}, chosen))
    show_keys(root, usual, present)
