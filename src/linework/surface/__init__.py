"""Road / non-road, ground, and height above road."""
