"""The screen under test: what the participant sees, where it opens, what was drawn when."""
