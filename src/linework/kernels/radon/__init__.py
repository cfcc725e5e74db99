"""Loops of the Radon transform and of rails along its peaks."""
