"""A stylus, a digitiser, a beam and a host stepped through time; they know nothing of the library that is judged."""

from .session import Truth, make_session

__all__ = ["Truth", "make_session"]
