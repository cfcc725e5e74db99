"""What the page shows: tiles, points, sections, heights and stereo images."""
