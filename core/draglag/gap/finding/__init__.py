"""Find: where the residuals are not noise, and what this session cannot tell apart."""
