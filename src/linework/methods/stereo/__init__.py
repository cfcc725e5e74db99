"""Lines from stereo pairs: found by themselves, or followed from a picked place."""
