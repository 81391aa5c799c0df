"""The paper's tests of a curve: how much misalignment it removes (Eq. 4), and the sanity checks."""
