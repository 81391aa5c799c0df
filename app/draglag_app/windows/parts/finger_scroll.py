"""Whatever scrolls follows a finger that is drawn over it; without this only its narrow bar does."""

from __future__ import annotations

from PySide6.QtWidgets import (
    QAbstractItemView,
    QAbstractScrollArea,
    QGraphicsView,
    QScroller,
    QScrollerProperties,
    QWidget,
)

_Metric = QScrollerProperties.ScrollMetric


def scroll_by_finger(root: QWidget) -> None:
    """Let all scroll areas below a widget be drawn by finger; in plots a finger moves what is drawn."""
    for area in root.findChildren(QAbstractScrollArea):
        if isinstance(area, QGraphicsView):
            continue
        if isinstance(area, QAbstractItemView):  # by rows, it would jump
            area.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        inside = area.viewport()
        QScroller.grabGesture(inside, QScroller.ScrollerGestureType.TouchGesture)
        scroller = QScroller.scroller(inside)
        manner = scroller.scrollerProperties()
        for metric in (_Metric.HorizontalOvershootPolicy, _Metric.VerticalOvershootPolicy):
            # Beyond its end there is nothing to see.
            manner.setScrollMetric(metric, QScrollerProperties.OvershootPolicy.OvershootAlwaysOff)
        scroller.setScrollerProperties(manner)
