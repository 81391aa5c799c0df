"""The screen under test: what is shown where, and what was drawn when."""
