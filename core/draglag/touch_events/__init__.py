"""Touchscreens: decoding the kernel's events, real or recorded."""
