"""Edits from the page: checked, completed with measured heights, and applied to the line file."""
