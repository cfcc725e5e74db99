"""Lane markings and road boundaries: oriented boxes, tracked through the points."""
