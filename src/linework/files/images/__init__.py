"""Images: stereo pairs, GeoTIFF, pictures for the page."""
