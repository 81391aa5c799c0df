"""What streams show before any fit."""
