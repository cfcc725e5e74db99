"""Edits of finished lines, and the queue of lines to be reviewed."""
