"""Touchscreens: decoding the kernel's events, live or recorded."""
