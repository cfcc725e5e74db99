"""Scan lines of laser points: recovered from the points' own fields, and counted as independent evidence."""
