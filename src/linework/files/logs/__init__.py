"""Logs of the van: GNSS, gyros, wheels, clocks, keys."""
