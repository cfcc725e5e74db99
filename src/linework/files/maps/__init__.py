"""Files of lines that other trades read: GeoParquet, LandXML, HD maps (Lanelet2, OpenDRIVE), QGIS projects."""
