"""What a surveyor decided about each item of two real surveys, by the pictures of the sessions: place, key and reason.

A decision holds for an item of its type and kind near its place, so that it finds the item again after the lines have
changed a little. An item without a decision is left: it is counted, and stands in the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: An item is the one that was decided on, if it is so near to its place. [m]
SAME_PLACE_M = 4.0


@dataclass(frozen=True)
class Decision:
    """What is done about an item: the key that is pressed, and why."""

    type: str
    kind: str
    at: tuple
    key: str
    why: str

    def is_for(self, item):
        here = np.hypot(item["at"][0] - self.at[0], item["at"][1] - self.at[1]) <= SAME_PLACE_M
        return here and (item["type"], item["kind"]) == (self.type, self.kind)


HERE_A22 = (
    Decision("line", "lane_marking", (657311.757, 5085357.313), "a", "a stripe of 28 cm along the whole line, in every metre"),
    Decision("line", "lane_marking", (657310.355, 5085357.769), "a", "a stripe of 24 cm along the whole line, behind the beams"),
    Decision("line", "lane_marking", (657315.187, 5085356.376), "a", "dashes of 4.5 m every 12 m, one hidden"),
    Decision("line", "lane_marking", (657325.506, 5085352.177), "a", "a stripe of 22 cm along the rail"),
    Decision("line", "lane_marking", (657317.673, 5085353.126), "a", "paint on both sides of the 6 m that are bridged, in line"),
    Decision("line", "guardrail", (657311.507, 5085359.049), "a", "the far beam of the median: points in 30 of 30 metres"),
    Decision("line", "guardrail", (657325.189, 5085350.573), "a", "points in 30 of 30 metres, at one height"),
    Decision("line", "guardrail", (657305.277, 5085380.901), "a", "in line with the rail before it, and as high"),
    Decision("line", "road_boundary", (657306.763, 5085332.813), "x",
             "runs across the carriageway where the points end; the step is 41 cm beside it"),
    Decision("rest", "road_boundary", (657325.644, 5085351.431), "a", "a step of 12 cm along the rail, and the far rail"),
    Decision("rest", "guardrail", (657294.370, 5085358.898), "a", "the far rail of the other carriageway, seen over its length"),
    Decision("sure", "guardrail", (657311.296, 5085357.369), "y", "looked at in the straightened view: on the beam throughout"),
    Decision("stretch", "", (657317.7, 5085356.8), "q", "each line of paint, rail and kerb that the points show has its line"),
    Decision("stretch", "", (657327.374, 5085376.531), "q", "each line of paint, rail and kerb that the points show has its line"),
)  # fmt: skip

STEREO_RAMP = (
    Decision("gap", "lane_marking", (27.479, -34.126), "x", "a second, shorter measurement of the far edge line"),
    Decision("gap", "lane_marking", (19.831, -32.688), "x", "on the asphalt beside the white line in all images"),
    Decision("gap", "lane_marking", (28.046, -22.565), "x", "a second, shorter measurement of the far edge line"),
    Decision("gap", "lane_marking", (28.004, -33.420), "x", "a second, shorter measurement of the far edge line"),
    Decision("gap", "lane_marking", (26.084, -13.803), "x", "one runs across the chevrons, the other is measured twice"),
    Decision("gap", "lane_marking", (26.496, -16.809), "x", "one runs across the chevrons, the other is measured twice"),
    Decision("gap", "lane_marking", (21.887, -8.704), "x", "runs across the chevrons"),
    Decision("gap", "lane_marking", (21.980, -6.852), "x", "runs across the chevrons"),
    Decision("gap", "lane_marking", (13.034, -8.598), "x", "on the asphalt beside the white line in all images"),
    Decision("copy", "lane_marking", (22.667, -17.001), "x", "on the asphalt beside the white edge of the chevrons"),
    Decision("copy", "lane_marking", (26.502, -40.299), "x", "measured from 20 m away; the other one goes on"),
    Decision("copy", "lane_marking", (26.846, -35.603), "x", "measured from 20 m away; the other one goes on"),
    Decision("copy", "lane_marking", (26.692, -38.765), "x", "measured from 20 m away; the other one goes on"),
    Decision("copy", "lane_marking", (19.399, -35.953), "x", "on the asphalt beside the white line in all images"),
    Decision("line", "lane_marking", (23.828, -20.673), "a", "on the white edge of the chevrons, and on the dashes after them"),
    Decision("line", "lane_marking", (26.264, -39.994), "a", "on the far edge line in all images, over its length"),
    Decision("line", "lane_marking", (17.451, -15.378), "a", "on the white edge line in all images"),
    Decision("line", "lane_marking", (26.062, -42.923), "x", "the far edge line once more; the other one is longer"),
    Decision("line", "lane_marking", (27.284, -31.254), "x", "the far edge line once more; the other one is longer"),
    Decision("line", "lane_marking", (23.213, -13.239), "x", "runs across the chevrons"),
    Decision("line", "lane_marking", (15.510, -11.272), "x", "on the asphalt beside the white line in all images"),
    Decision("gap", "lane_marking", (19.696, -31.696), "q", "the edge line goes on in the next line, to be joined"),
    Decision("gap", "lane_marking", (5.924, -4.023), "q", "before the first image that shows it near enough"),
    Decision("gap", "lane_marking", (5.445, 2.200), "q", "before the first image that shows it near enough"),
    Decision("sure", "lane_marking", (17.776, -45.497), "y", "on the white edge line in all images"),
    Decision("stretch", "", (19.547, -14.533), "q", "what is left is the outer edge of the chevrons, drawn next"),
)  # fmt: skip


def decided(decisions, item):
    """The decision on an item, of several the nearest; None where none was made.

    Each was made about one item: give those that are not used yet.
    """
    fitting = [one for one in decisions if one.is_for(item)]
    return min(
        fitting, key=lambda one: np.hypot(item["at"][0] - one.at[0], item["at"][1] - one.at[1]), default=None
    )
