"""Coordinate reference systems and the shape of the earth."""
