"""The posterior over explanations: one model, one rule for every member (docs/gap.md)."""
