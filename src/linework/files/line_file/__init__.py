"""The GeoPackage that people edit: lines, history, undo."""
