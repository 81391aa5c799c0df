"""Refits with one more effect: where each begins, and what the traces show of it. They propose; evidence decides."""
