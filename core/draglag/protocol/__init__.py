"""Protocols and screens in TOML, the runs they make, and the moving targets."""
