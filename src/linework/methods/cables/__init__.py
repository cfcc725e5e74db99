"""Cables and other wires."""
