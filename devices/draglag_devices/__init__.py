"""Sources of timed samples, real, simulated or replayed."""
