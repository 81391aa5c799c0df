"""Protocols, screens, icons, theme, manual and translations, read through importlib.resources."""
