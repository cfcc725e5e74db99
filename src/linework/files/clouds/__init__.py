"""Points in formats of scanners and robots (PLY, PCD, E57), read as those of laser files are."""
