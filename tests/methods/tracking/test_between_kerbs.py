"""Edges within the carriageway of two kerbs: what they are told from, and the paint along them that stays."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes.box_scenes import boxes_on, everything_seen, straight

from linework.methods.obb.method import Obb
from linework.methods.protocol import SurveyContext
from linework.methods.tracking.arrangement import SEAM, between_kerbs, bounds_carriageway
from linework.methods.tracking.neighbours import LineAxis
from linework.model.boxes import BoxForm, BoxSet


def axis(y: float, *, turned: bool = False) -> LineAxis:
    t = np.linspace(0.0, 40.0, 81)
    xyz = np.column_stack([t[::-1] if turned else t, np.full(81, y), np.zeros(81)])
    return LineAxis.of(t, xyz)


#: Two kerbs that face each other over 11 m.
KERBS = [axis(0.0), axis(11.0, turned=True)]


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        ([axis(5.5)], [True]),
        ([axis(5.5, turned=True)], [True]),
        # The edges of a median look away from one another
        ([axis(4.0, turned=True), axis(7.0)], [False, False]),
        # A gutter, or a footway with the kerb-like foot of a wall behind it
        ([axis(1.0)], [False]),
        ([axis(2.5)], [False]),
        # Behind a kerb there is no carriageway
        ([axis(-3.0)], [False]),
    ],
)
def test_only_what_two_kerbs_face_is_between_them(others: list[LineAxis], expected: list[bool]) -> None:
    is_kerb = np.array([True, True, *[False] * len(others)])
    assert between_kerbs([*KERBS, *others], is_kerb).tolist() == [False, False, *expected]


@pytest.mark.parametrize("paint_m", [5.4, 5.6])
def test_a_change_of_surface_along_paint_between_kerbs_is_a_seam(paint_m: float) -> None:
    why = bounds_carriageway(
        [*KERBS, axis(5.5)], np.array([True, True, False]), np.array([True, True, False]), [axis(paint_m)], ()
    )
    assert why.tolist() == ["", "", SEAM]


def test_a_sure_edge_between_kerbs_leaves_the_paint_behind_it() -> None:
    """A joint of two layers of asphalt runs 0.1 m beside the centre line of a street."""
    back = straight(60.0, x=60.0, y=11.0, heading=np.pi)
    boxes = [
        boxes_on(straight(60.0), back, form=BoxForm.KERB),
        boxes_on(straight(60.0, y=5.5), form=BoxForm.EDGE),
        boxes_on(straight(60.0, y=5.4)),
    ]
    context = SurveyContext(origin=(0.0, 0.0, 0.0), path=None, is_visible=everything_seen)
    found = Obb().join(BoxSet.concatenate(boxes), context)
    assert np.count_nonzero(found.kind == "lane_marking") == 1
    assert found.form[found.kind == "road_boundary"].tolist() == ["kerb", "kerb"]
