"""Loops over points that are classified, by the lines near them and by what stands above the ground."""
