"""Protocols and screens in TOML, their runs, and moving targets."""
