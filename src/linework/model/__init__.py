"""Frozen values that flow from room to room: points, images, trajectories, lines, surveys."""
