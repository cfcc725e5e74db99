"""Points in formats of scanners and robots (PLY, PCD), read as those of laser files are."""
