"""What is asked of the participant: protocols and screens in TOML, the runs they make, and the moving targets."""
