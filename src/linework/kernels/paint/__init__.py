"""Kernels that find stripes of paint in points near the road, measure them, and find their pattern."""
