"""JSON Schemas and the page on the session file, made from the code that writes and reads them."""

from draglag.schemas.make import schemas, write

__all__ = ["schemas", "write"]
