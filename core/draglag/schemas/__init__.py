"""JSON Schemas and the page on the session file."""

from draglag.schemas.make import schemas, write

__all__ = ["schemas", "write"]
