"""Which lines contradict others, and which of them gives way."""

import numpy as np
from tests.scenes.box_scenes import boxes_on, everything_seen, straight

from linework.methods.obb.joining import begin, find_edges, find_kerbs, find_paint, keep_consistent
from linework.methods.protocol import SurveyContext
from linework.methods.tracking.track import TrackConfig
from linework.model.boxes import BoxForm, BoxSet

#: The van drives along the x-axis.
PATH = np.column_stack([np.linspace(0.0, 60.0, 61), np.zeros((61, 2))])


def taken(*boxes):
    """Middle places y of the markings and boundaries that are taken."""
    survey = SurveyContext(origin=(0.0, 0.0, 0.0), path=PATH, is_visible=everything_seen)
    now = begin(BoxSet.concatenate(boxes), survey, TrackConfig())
    for step in (find_kerbs, find_edges, find_paint, keep_consistent):
        now = step(now)
    return [
        [round(float(np.median(line.line.xyz[:, 1])), 1) for line in lines]
        for lines in (now.markings, now.boundaries)
    ]


def stripe(y):
    return boxes_on(straight(60.0, y=y), form=BoxForm.STRIPE)


def edge(y, heading, x=0.0):
    """An edge whose carriageway lies to the left of its heading."""
    return boxes_on(straight(60.0, x=x, y=y, heading=heading), form=BoxForm.EDGE)


def test_an_edge_without_a_carriageway_does_not_take_the_paint_behind_it():
    towards_the_road, away_from_it = edge(4.0, np.pi, x=60.0), edge(4.0, 0.0)
    assert taken(stripe(2.5), towards_the_road) == [[2.5], [4.0]]
    assert taken(stripe(2.5), away_from_it) == [[2.5], []]
