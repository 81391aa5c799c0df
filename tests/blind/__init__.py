"""Hidden-effect benchmark: a physics generator, the conditions, and the scoring.

Shares no code with the library it judges.
"""
