"""Exports of sessions and figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QCoreApplication

from draglag import exchange
from draglag.store import read_analyses
from draglag_app.windows.files import do_work, proposed
from draglag_app.windows.parts.ask_files import ask_new_folder, ask_save

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


def tr(text: str) -> str:
    return QCoreApplication.translate("Files", text)


def export_as(window: OperatorWindow, kind: str) -> None:
    """Write the session as "csv", "netcdf" or "mat"."""
    session, source = window.space.session, window.space.path
    if session is None:
        window.notify("info", tr("There is no session to export yet."))
        return
    writers = {"csv": exchange.write_csv, "netcdf": exchange.write_netcdf, "mat": exchange.write_mat}

    def begin(path: Path) -> None:
        def write() -> Path:
            results = () if source is None else read_analyses(source)
            return writers[kind](session, path, results=results)

        left = exchange.left_out(session, kind)
        more = tr("Not in this format: {parts}").format(parts=", ".join(left)) if left else ""
        do_work(window, tr("Exporting"), lambda progress: write(), path, more)

    if kind == "csv":
        ask_new_folder(window, tr("Export into which (new or empty) folder?"), proposed(window, "csv"), begin)
        return
    suffix = {"netcdf": "nc", "mat": "mat"}[kind]
    title = tr("Export netCDF") if kind == "netcdf" else tr("Export MATLAB")
    start = proposed(window, "export").with_suffix(f".{suffix}")
    ask_save(window, title, start, f"*.{suffix}", begin)


def export_figures(window: OperatorWindow) -> None:
    """Write figures in journal widths."""
    session, analysis = window.space.session, window.space.analysis
    if session is None or analysis is None:
        window.notify("info", tr("There are no results to report yet."))
        return

    def begin(path: Path) -> None:
        from draglag.report.journal import write_journal_figures

        do_work(window, tr("Drawing figures"), lambda progress: write_journal_figures(session, analysis, path), path)

    ask_new_folder(window, tr("Folder for the figures"), proposed(window, "figures"), begin)


def export_gap_report(window: OperatorWindow) -> None:
    """Write the gap report."""
    from draglag_app.windows.pages.gap import GapPage

    page = window.pages["gap"][1]
    assert isinstance(page, GapPage)
    page.write_report()
