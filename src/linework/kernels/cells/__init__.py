"""Loops over cells of a raster."""
