"""The command line. Commands are imported on use: `draglag --help` is fast."""

from draglag_app.cli.main import cli, main

__all__ = ["cli", "main"]
