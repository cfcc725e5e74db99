"""Loops over stereo images."""
