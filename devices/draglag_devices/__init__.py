"""Sources of timed samples: touch, laser and WALT, real, simulated or replayed."""
