"""Images: rasters of laser points and their pictures, rectification and pairing of stereo images, projected lines."""
