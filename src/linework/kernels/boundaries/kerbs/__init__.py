"""Kernels that find kerbs: straight steps, ramps and bends, and what hides their sides."""
