"""Compiled loops (numba): numbers in, numbers out; serial, nogil, cached, never run at import."""
