"""Snapping to the edge under the cursor: true lines of a simulated drive, and a place without any edge."""

from __future__ import annotations

import numpy as np
import pytest
from tests.workbench.hand_drawn import hands, off

from linework.files.vectors.read_write import read_lines
from linework.workbench.views.patches import PatchReader, PointPatch
from linework.workbench.views.snap import _points_about, snapped_place
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

REACH_M = 0.3


@pytest.fixture
def session(drive):
    """Return the session of a worker, here in this process: the drive opened."""
    session = SurveySession(SurveyOrder((drive,)), lambda _value: None)
    yield session
    session._held.close()


@pytest.fixture(scope="module")
def truth(made_drive):
    return read_lines(made_drive / "truth.gpkg")


@pytest.mark.parametrize(("kind", "edges"), [("lane_marking", {"stripe"}), ("kerb_top", {"top"})])
def test_a_place_beside_an_edge_is_moved_onto_it(session, truth, kind, edges):
    rng = np.random.default_rng(4)
    moved = []
    for place, xy, heading in hands(truth, kind, rng):
        found = snapped_place(session, kind, tuple(place), REACH_M, heading)
        if found is not None:
            assert found["edge"] in edges
            moved.append(off(np.array(found["at"]), xy))
    assert len(moved) >= 4
    assert np.mean(np.array(moved) < 0.03) >= 0.7, "by hand all were 8 cm off"


def test_the_direction_need_not_be_known_and_the_order_of_points_does_not_matter(session, truth, monkeypatch):
    place = next(
        one[0]
        for one in hands(truth, "lane_marking", np.random.default_rng(4))
        if (found := snapped_place(session, "lane_marking", tuple(one[0]), REACH_M, None)) is not None
        and off(np.array(found["at"]), one[1]) < 0.03
    )
    first = snapped_place(session, "lane_marking", tuple(place), REACH_M, None)
    points = _points_about(patch_reader(session), tuple(place))
    patches = PatchReader.patches

    def shuffled(reader, bounds, **how):
        for patch in patches(reader, bounds, **how):
            order = np.random.default_rng(1).permutation(len(patch))
            yield PointPatch(patch.corner, *(column[order] for column in patch.columns))

    monkeypatch.setattr(PatchReader, "patches", shuffled)
    assert np.array_equal(_points_about(patch_reader(session), tuple(place)), points)
    assert snapped_place(session, "lane_marking", tuple(place), REACH_M, None) == first


def test_on_bare_asphalt_and_far_from_all_points_nothing_is_moved(session, truth):
    paint = np.concatenate([line.xyz[:, :2] for line in truth if line.kind != "cable"])
    path = session.recordings.trajectory.xyz[:, :2]
    bare = [place for place in path[::20] if np.hypot(*(paint - place).T).min() > 1.0]
    assert len(bare) >= 3
    found = [snapped_place(session, "lane_marking", tuple(place), REACH_M, None) for place in bare]
    assert sum(one is not None for one in found) <= len(bare) // 10
    assert snapped_place(session, "lane_marking", (0.0, 0.0), REACH_M, None) is None


def test_what_makes_no_sense_is_refused(served):
    for query in (
        "kind=lane_marking&east=0&north=0&reach_m=9",
        "kind=lane_marking&east=0&north=nan&reach_m=0.2",
        "kind=lane_marking&east=0&north=0&reach_m=1e-300",
    ):
        assert served.client.get(f"/api/snap?{query}").status_code == 422
    assert served.client.get("/api/snap?kind=x&east=0&north=0&reach_m=0.2").status_code == 400
    assert served.get("/api/snap?kind=cable&east=0&north=0&reach_m=0.2") == {"found": None}
