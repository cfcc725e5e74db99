"""Lines: positions along them, ids, catenaries, merging of two methods."""
