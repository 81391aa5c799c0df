"""Scrolling by finger."""

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
    """Let scroll areas be dragged, except plots."""
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
