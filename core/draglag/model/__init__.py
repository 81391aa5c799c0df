"""The latency law put to use: as a file, on recorded events, in a tracking task."""
