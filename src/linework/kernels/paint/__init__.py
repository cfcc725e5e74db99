"""Loops over the points of painted stripes."""
