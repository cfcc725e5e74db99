"""Following one line from one place, on the ground and in images."""
