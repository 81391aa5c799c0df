"""Where the stylus was, and how fast."""
