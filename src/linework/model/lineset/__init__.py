"""What a set of lines is to Python and to other libraries: one line, geometries, tables, pictures."""
