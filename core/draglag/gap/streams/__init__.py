"""What the touch and laser streams show before any residual: how events are stamped, held, rounded, filled in."""
