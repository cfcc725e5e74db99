"""Loops that pack and order points for the store."""
