"""Extractions started from the page."""
