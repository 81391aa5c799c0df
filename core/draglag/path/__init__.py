"""Where the stylus was, and how fast: usable touch events, smoothed motion, a latency law undone."""
