"""What was written for the operator is one press away: a report in the browser, a folder in the file manager."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, QUrl, Slot
from PySide6.QtGui import QDesktopServices

from draglag_app.windows.files import do_work


class Desktop(QObject):
    """Opens files, and knows which."""

    def __init__(self) -> None:
        super().__init__()
        self.opened: list[Path] = []

    @Slot(QUrl)
    def open(self, url: QUrl) -> None:
        self.opened.append(Path(url.toLocalFile()))


@pytest.fixture
def desktop(qapp: object) -> Iterator[Desktop]:
    made = Desktop()
    QDesktopServices.setUrlHandler("file", made, "open")
    yield made
    QDesktopServices.unsetUrlHandler("file")


def test_a_report_and_a_folder_can_be_opened_and_a_table_cannot(
    open_window: Callable, until: Callable, tmp_path: Path, desktop: Desktop
) -> None:
    window = open_window()
    notice = window.notice
    report, folder, table = tmp_path / "s-report", tmp_path / "s-csv", tmp_path / "s.mat"
    for where in (report, folder):
        where.mkdir()
    (report / "report.html").write_text("<p>", "utf-8")
    table.write_bytes(b"")
    for where, shown in ((report, report / "report.html"), (folder, folder)):
        do_work(window, "Writing", lambda progress: None, where, "more")
        until(lambda shown=shown: str(shown) in notice.text.text() and notice.open.isVisible())
        assert notice.text.text().endswith(" · more")
        notice.open.click()
    assert desktop.opened == [report / "report.html", folder]
    do_work(window, "Writing", lambda progress: None, table)
    until(lambda: str(table) in notice.text.text())
    assert not notice.open.isVisible()
    window.notify("info", "something else")
    assert not notice.open.isVisible()
