"""The latency law as a file, on recorded events, in a tracking task."""
