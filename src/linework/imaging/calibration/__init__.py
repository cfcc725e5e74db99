"""Calibration of a stereo rig from corners followed over its pairs, and from the path of the van."""
