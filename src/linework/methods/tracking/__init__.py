"""Lines tracked through oriented boxes, smoothed and described: shared by the obb and stereo methods."""
