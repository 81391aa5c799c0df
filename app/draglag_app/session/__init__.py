"""The acquisition session."""

from draglag_app.session.acquire import run_session
from draglag_app.session.control import Control
from draglag_app.session.display import Display, OffscreenDisplay
from draglag_app.session.options import SessionOptions

__all__ = ["Control", "Display", "OffscreenDisplay", "SessionOptions", "run_session"]
