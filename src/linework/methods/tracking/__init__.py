"""Lines tracked through boxes: what obb and stereo share."""
