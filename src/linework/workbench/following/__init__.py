"""Following a line from a click, and bridging its gaps."""
