"""Reports for people: one self-contained page and its figures."""

from draglag.report.write import write_report

__all__ = ["write_report"]
