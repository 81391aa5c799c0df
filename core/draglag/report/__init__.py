"""Reports for people: self-contained pages and figures."""

from draglag.report.write import write_report

__all__ = ["write_report"]
