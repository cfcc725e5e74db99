"""Loops that track boxes and smooth lines."""
