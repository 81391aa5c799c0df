"""The command line, which imports commands on use."""

from draglag_app.cli.main import cli, main

__all__ = ["cli", "main"]
