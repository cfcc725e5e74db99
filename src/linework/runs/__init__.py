"""Runs of an extraction: tiles, tasks, journal, outputs."""
