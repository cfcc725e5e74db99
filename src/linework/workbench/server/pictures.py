"""Images of the plan as the page lists them, and the limits of what it may ask to see.

Separate from the modules that make pictures, because the server does not import those: only its workers make any.
"""

from __future__ import annotations

from typing import Any, Literal

from linework.errors import AbsentError
from linework.methods.classes.point_class import PointClass

#: Image of a stereo pair.
CameraSide = Literal["left", "right"]
#: Most points shown at once: a page holds each in 15 bytes, and a graphics card draws them smoothly.
MOST_SHOWN_POINTS = 1_000_000
#: Largest half width and thickness of a section. [m]
WIDEST_M, THICKEST_M = 60.0, 20.0
#: Largest distance from the axis of the straightened view to each side. [m]
FARTHEST_OFFSET_M = 30.0
#: Farthest that a drawn place is moved, as far as `linework.methods.templates.across` looks for edges; and the least reach
#: that may be asked for: no hand is steadier, and no point better. [m]
FARTHEST_SNAP_M, LEAST_SNAP_M = 0.40, 0.01
#: Names of the images of the plan that are of classes, and of what the cameras saw.
CLASS_IMAGE, ROAD_IMAGE = "class", "road"
#: Class, title and colour; of several classes in one pixel the last in this list is shown: what is thin or high.
CLASS_COLOURS = (
    (PointClass.OTHER, "Other", "#3a3d42"),
    (PointClass.VERGE, "Verge", "#7c9a5e"),
    (PointClass.VEGETATION, "Vegetation", "#2f7d3a"),
    (PointClass.FOOTWAY, "Footway", "#c9a26b"),
    (PointClass.ROAD, "Road", "#6b7078"),
    (PointClass.KERB, "Kerb", "#f2d03b"),
    (PointClass.MARKING, "Marking", "#ffffff"),
    (PointClass.BARRIER, "Barrier", "#2f6fe0"),
    (PointClass.RAIL, "Guardrail", "#35c4e8"),
    (PointClass.POLE, "Pole", "#ff7a2f"),
    (PointClass.WIRE, "Wire", "#ff5fd2"),
)


def class_image() -> dict[str, object]:
    """Return the image as the page lists it, with its classes."""
    classes = [{"title": title, "colour": colour} for _, title, colour in CLASS_COLOURS]
    return {"name": CLASS_IMAGE, "title": "Class", "unit": "", "classes": classes}


def road_image() -> dict[str, Any]:
    """Return the image of the road as the cameras saw it, as the page lists it."""
    return {"name": ROAD_IMAGE, "title": "Road image", "unit": "", "classes": []}


def no_such_pair_error(number: int) -> AbsentError:
    """Return the error to raise if no pair has a number."""
    return AbsentError(f"there is no pair {number}")
