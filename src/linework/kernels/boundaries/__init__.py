"""Kernels that find the edges of the carriageway in cross profiles: kerbs, pavement edges, barriers."""
