"""Proposals to the posterior, asked of each effect's home: refits, what traces and edges show."""
