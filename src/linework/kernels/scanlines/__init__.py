"""Loops over the scan lines of laser points: tracking, turns of the mirror, spacing, and counts of crossings."""
