"""JSON Schemas of what draglag writes and reads, and the page on the session file, made from the code that does it."""

from draglag.schemas.make import schemas, write

__all__ = ["schemas", "write"]
