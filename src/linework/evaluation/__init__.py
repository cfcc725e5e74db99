"""Extracted lines against reference lines: completeness, correctness, errors."""
