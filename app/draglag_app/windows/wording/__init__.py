"""What the operator reads, in the settings' language."""
