"""Lines in a PostGIS database: published in one transaction, and read back."""
