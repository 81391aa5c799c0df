"""What the touch and laser streams show before any residual: how events are stamped, sampled, rounded, interpolated."""
