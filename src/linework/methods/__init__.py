"""The published extraction systems, one folder each."""
