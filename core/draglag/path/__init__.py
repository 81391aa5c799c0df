"""Where the stylus was, and how fast: usable touch events, smoothed position and speed, and a latency law undone."""
