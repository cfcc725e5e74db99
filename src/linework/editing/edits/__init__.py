"""Pure functions that change finished lines."""
