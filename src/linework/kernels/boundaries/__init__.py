"""Loops over cross profiles: kerbs, pavement edges, barriers."""
