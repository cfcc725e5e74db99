"""Kernels for lines: tracked through boxes, smoothed, compared and timed; and small linear systems."""
