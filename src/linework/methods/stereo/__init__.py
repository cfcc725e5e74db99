"""Automatic extraction of lane markings from stereo pairs."""
