"""Where a simulated road goes."""
