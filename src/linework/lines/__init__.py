"""Fitting, smoothing, joining of lines, and catenaries."""
