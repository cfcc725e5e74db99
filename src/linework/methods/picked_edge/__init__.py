"""One edge, picked in an image and followed."""
