"""Recordings of surveys that have points alone."""

from linework.runs.opened.recordings import Recordings


def of_points(opened):
    """Return the recordings of an opened survey of points."""
    return Recordings(survey=opened.survey, points=opened, stereo=None, hashes=opened.hashes)
