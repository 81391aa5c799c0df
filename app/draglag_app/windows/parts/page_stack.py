"""Pages, scrolled in a small window."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QScrollArea, QSizePolicy, QStackedWidget, QWidget

from draglag_app.windows.parts.follow_focus import FollowFocus

# A window smaller than that shows too little of any page to work with.
_LEAST = QSize(320, 160)
# So wide that every text has its least lines.
_WIDE_PX = 10_000


class PageStack(QStackedWidget):
    """As large as the visible page."""

    def __init__(self) -> None:
        super().__init__()
        self.currentChanged.connect(lambda index: self.updateGeometry())

    def minimumSizeHint(self) -> QSize:
        page = self.currentWidget()
        if page is None:
            return super().minimumSizeHint()
        least, layout = page.minimumSizeHint().expandedTo(page.minimumSize()), page.layout()
        if layout is not None and layout.hasHeightForWidth():
            # Labels that wrap count the lines of a narrow page; how many there are is asked of heightForWidth.
            least.setHeight(max(page.minimumHeight(), layout.minimumHeightForWidth(_WIDE_PX)))
        return least

    def sizeHint(self) -> QSize:
        return self.minimumSizeHint()

    def heightForWidth(self, width: int) -> int:
        """The least height of the visible page; Qt takes the preferred height of the tallest."""
        page = self.currentWidget()
        layout = None if page is None else page.layout()
        if layout is None or not layout.hasHeightForWidth():
            return self.minimumSizeHint().height()
        return layout.minimumHeightForWidth(width)


class PageScroll(QScrollArea):
    """Scrolls the visible page, and follows the focus."""

    def __init__(self, stack: PageStack) -> None:
        super().__init__()
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setWidgetResizable(True)
        self.setWidget(stack)
        FollowFocus(self)
        stack.currentChanged.connect(lambda index: self.verticalScrollBar().setValue(0))

    def minimumSizeHint(self) -> QSize:
        return _LEAST

    def sizeHint(self) -> QSize:
        inside = self.widget()
        return _LEAST if inside is None else inside.sizeHint()


class ColumnScroll(QScrollArea):
    """A column, scrolled if too high."""

    def __init__(self, column: QWidget) -> None:
        super().__init__()
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setWidgetResizable(True)
        self.setWidget(column)
        column.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.Resize, QEvent.Type.LayoutRequest):
            self.updateGeometry()
        return super().eventFilter(watched, event)

    def minimumSizeHint(self) -> QSize:
        return QSize(self.sizeHint().width(), _LEAST.height())

    def sizeHint(self) -> QSize:
        inside, bar = self.widget(), self.verticalScrollBar()
        if inside is None:
            return _LEAST
        hint = inside.minimumSizeHint()
        bar_px = bar.sizeHint().width() if hint.height() > self.height() else 0
        return QSize(inside.minimumWidth() + bar_px, hint.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.updateGeometry()  # room for the bar, or none
