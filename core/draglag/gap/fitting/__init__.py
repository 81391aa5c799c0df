"""The joint fit of curve, beam and effects."""
