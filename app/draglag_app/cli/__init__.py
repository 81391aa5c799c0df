"""The command line. Commands are imported when they are used, so that `draglag --help` answers at once."""

from draglag_app.cli.main import cli, main

__all__ = ["cli", "main"]
