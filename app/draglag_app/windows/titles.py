"""Window title, source of figures."""

from __future__ import annotations

from datetime import UTC, datetime

from PySide6.QtCore import QCoreApplication

from draglag.provenance import Source, source_of
from draglag_app.windows.workspace import Workspace


def tr(text: str) -> str:
    return QCoreApplication.translate("titles", text)


def window_title(space: Workspace) -> str:
    """Program, session or recording, simulated or not."""
    name = "" if space.session is None else space.session.name
    if space.recording.active and space.recording.order is not None:
        name = space.recording.order.out.name
    mark = tr("SIMULATED") if space.simulated else ""
    return " – ".join(part for part in ("draglag", name, mark) if part)


def figure_source(space: Workspace) -> str:
    """The line under a figure."""
    if space.recording.active and space.recording.order is not None:
        now = datetime.now(UTC).isoformat(timespec="seconds")
        return Source(space.recording.order.out.name, now, space.simulated).line()
    if space.session is None:
        return Source(tr("no session"), "", False).line()
    return source_of(space.session).line()
