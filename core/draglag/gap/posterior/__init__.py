"""The posterior over explanations (docs/gap.md)."""
