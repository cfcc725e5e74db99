"""Loops over points of cables."""
