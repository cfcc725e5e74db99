"""Numba kernels over stereo images: stripes, matching, road disparities, fusion, thinning, simulated grain."""
