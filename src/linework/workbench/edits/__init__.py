"""Edits that the page asks for, applied to the line file."""
