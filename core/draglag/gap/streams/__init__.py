"""What the touch and laser streams show before any fit."""
