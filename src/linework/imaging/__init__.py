"""Raster images of laser points: density, maximum, minimum and mean height, intensity, binary."""
