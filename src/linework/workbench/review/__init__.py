"""The review queue: what is worth checking in the lines, and the paint that shows missing dashes."""
