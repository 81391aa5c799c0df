"""Sources of timed samples: touch, laser and WALT, each real, simulated and replayed. No Qt."""
