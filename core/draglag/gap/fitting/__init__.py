"""The joint fit of curve, beam and effects, with noise estimated from the session."""
