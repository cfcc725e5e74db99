"""The review queue, and what a new extraction carries over from earlier reviews."""
