"""The public functions: from files or arrays to lines, in one call each. `linework` gives them their short names."""
