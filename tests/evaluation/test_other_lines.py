"""Widths up to what may be another line than the end of the carriageway: rows of stones, and what lies behind them."""

import numpy as np
import pytest
from tests.scenes.chainage_scenes import rows_of, straight

from linework.evaluation.chainage.rows import chainage_report

#: A street with a kerb on the right; the other edge of the pavement was found for its first half.
STREET = [
    ("middle", "lane_marking", 0.0, 0.0, "dashed", (0, 100)),
    ("right", "road_boundary", -3.4, 0.0, "", (0, 100)),
    ("edge", "road_boundary", 3.4, 0.0, "", (0, 48)),
]
WALL = ("wall", "road_boundary", 4.1, 0.0, "", (52, 100))


def widths_of(table, quantity, forms=None, roles=None, **changed):
    """Return the widths [m] of the first and the second half of a street, None where there is no number."""
    lines, axis = straight(table)
    names = lines.id.tolist()
    lines = lines.with_columns(
        form=np.array([(forms or {}).get(name, "edge") for name in names]),
        role=np.array([(roles or {}).get(name, "") for name in names]),
        **changed,
    )
    report = chainage_report(lines, [axis], every_m=50.0)
    rows = [r for r in rows_of(report, quantity) if r.line in ("", "middle | stripe") and r.from_m < 100.0]
    return [r.value if r.value is None else round(r.value, 6) for r in rows]


@pytest.mark.parametrize(
    ("stripe_m", "carriageway", "lanes"),
    [
        # Stones behind the edge of the pavement: what lies behind them is the wall of a house
        (3.5, [6.8, None], [None, None]),
        # An edge line before it, before what may be another end of the pavement
        (3.25, [6.8, 7.5], [3.25, 3.25]),
        # Where the line is as far from the axis as the edge, by their deviations, it may be an edge line
        (3.41, [6.8, 7.5], [3.41, 3.41]),
    ],
)
def test_stones_behind_the_edge_are_no_edge_line(stripe_m, carriageway, lanes):
    table = [*STREET, WALL, ("stripe", "lane_marking", stripe_m, 0.0, "solid", (0, 100))]
    assert widths_of(table, "carriageway_width") == carriageway
    assert widths_of(table, "lane_width") == lanes


def test_a_kerb_behind_stones_is_the_end_of_the_carriageway():
    table = [*STREET, WALL, ("stripe", "lane_marking", 3.5, 0.0, "solid", (0, 100))]
    assert widths_of(table, "carriageway_width", forms={"wall": "kerb"}) == [6.8, 7.5]


def test_a_boundary_behind_stones_is_none_where_these_were_not_found():
    table = [*STREET, WALL, ("stripe", "lane_marking", 3.5, 0.0, "solid", (0, 70))]
    assert widths_of(table, "carriageway_width") == [6.8, None]


def test_a_boundary_that_goes_over_to_the_wall_is_right_before_the_stones():
    """One line: along the edge of the pavement first, then along the wall."""
    table = [*STREET[:2], ("edge", "road_boundary", 3.4, 0.0, "", (0, 100))]
    lines, axis = straight([*table, ("stripe", "lane_marking", 3.5, 0.0, "solid", (0, 100))])
    s = np.linalg.norm(lines.xyz[:, :2] - [500_000, 5_400_000], axis=1)
    is_at_wall = (lines.id[lines.line_of_vertex] == "edge") & (s > 49.0)
    xyz = lines.xyz + np.where(is_at_wall, 0.7, 0.0)[:, None] * np.append(axis.left[0], 0.0)
    report = chainage_report(lines.with_columns(xyz=xyz), [axis], every_m=25.0)
    widths = [r.value for r in rows_of(report, "carriageway_width") if r.from_m < 100.0]
    assert widths == [pytest.approx(6.8), pytest.approx(6.8), None, None]


def test_stones_behind_a_gutter_are_no_edge_line():
    gutter = ("gutter", "edge_other", 3.4, 0.0, "", (0, 100))
    table = [*STREET[:2], gutter, ("stripe", "lane_marking", 3.5, 0.0, "solid", (0, 100))]
    table.append(("wall", "road_boundary", 4.1, 0.0, "", (0, 100)))
    assert widths_of(table, "carriageway_width", roles={"gutter": "gutter"}) == [None, None]
    assert widths_of(table, "carriageway_width", roles={"gutter": "verge"}) == [7.5, 7.5]


def test_the_edge_line_of_another_carriageway_lies_behind_its_median():
    """As seen from the axis it is beyond an edge of the pavement."""
    table = [
        *STREET[:2],
        ("median", "road_boundary", 8.0, 0.0, "", (0, 100)),
        ("inner", "lane_marking", 8.3, 0.0, "solid", (0, 100)),
        ("outer", "lane_marking", 11.8, 0.0, "solid", (0, 100)),
        ("end", "road_boundary", 12.1, 0.0, "", (0, 100)),
    ]
    lines, axis = straight(table)
    rows = rows_of(chainage_report(lines, [axis], every_m=50.0), "lane_width", line="inner | outer")
    assert {round(r.value, 6) for r in rows} == {3.5}


@pytest.mark.parametrize(
    ("line_m", "kerb_m", "role"), [(0.55, 0.30, ""), (0.70, 0.45, ""), (0.55, 0.3, "centre")]
)
def test_lines_around_an_island_are_no_stones(line_m, kerb_m, role):
    table = [
        ("out", "road_boundary", -3.8, 0.0, "", (0, 100)),
        ("end", "road_boundary", 3.8, 0.0, "", (0, 100)),
    ]
    roles = {}
    for side in (-1.0, 1.0):
        table += [(f"line {side}", "lane_marking", side * line_m, 0.0, "solid", (0, 100)),
                  (f"island {side}", "road_boundary", side * kerb_m, 0.0, "", (40, 60))]  # fmt: skip
        roles[f"line {side}"] = role
    assert widths_of(table, "carriageway_width", roles=roles)[1] == pytest.approx(7.6)


def test_a_stripe_on_the_very_edge_is_one_though_lines_state_no_deviations():
    table = [*STREET[:2], ("edge", "road_boundary", 3.4, 0.0, "", (0, 100)),
             ("stripe", "lane_marking", 3.4 + 1e-6, 0.0, "solid", (0, 100))]  # fmt: skip
    for sigma_m in (0.0, np.nan):
        n = len(straight(table)[0].xyz)
        assert widths_of(table, "carriageway_width", sigma_xy_m=np.full(n, sigma_m)) == [6.8, 6.8]
    stones = [*STREET, WALL, ("stripe", "lane_marking", 3.5, 0.0, "solid", (0, 100))]
    n = len(straight(stones)[0].xyz)
    assert widths_of(stones, "carriageway_width", sigma_xy_m=np.full(n, np.nan)) == [6.8, None]
