"""The latency law put to use: as a file, on recorded touch events, and in a tracking task."""
