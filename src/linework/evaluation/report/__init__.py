"""The report and the other pictures and tables people read."""
