"""Where the van was: frames, lever arms, paths."""
