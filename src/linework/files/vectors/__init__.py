"""Files of lines: GeoPackage, GeoJSON, DXF, KML and what GDAL reads."""
