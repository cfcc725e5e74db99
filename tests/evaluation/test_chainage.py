"""Reports by chainage: known roads give their own numbers, what is hidden is unknown, tables hold the same rows."""

import csv
import io
import sqlite3

import numpy as np
import openpyxl
import pytest
from tests.scenes.chainage_scenes import ROAD, rows_of, straight
from tests.scenes.map_scenes import road_lines

from linework.errors import InputError, UsageError
from linework.evaluation.chainage.routes import own_routes, route_of_path, routes_of_file
from linework.evaluation.chainage.rows import chainage_report
from linework.evaluation.chainage.standards import LIMITS
from linework.files.vectors.read_write import write_lines
from linework.lines.crosscuts import cross_cuts
from linework.model.lines import LineSet


def test_a_straight_road_has_its_own_numbers():
    lines, axis = straight(ROAD, crossfall=-0.025)
    report = chainage_report(lines, [axis], standard="us")
    widths = rows_of(report, "lane_width", line="middle | edge")
    assert [(r.from_m, r.to_m) for r in widths] == [(10.0 * i, 10.0 * i + 10) for i in range(10)] + [
        (100.0, 100.0)
    ]
    np.testing.assert_allclose([r.value for r in widths], 3.5, atol=1e-6)
    np.testing.assert_allclose([r.sigma for r in widths], 0.006 * np.sqrt(2))
    assert {r.side for r in widths} == {"left"} and {r.n for r in widths[:10]} == {10}
    np.testing.assert_allclose([r.value for r in rows_of(report, "carriageway_width")], 7.4, atol=1e-6)
    # The left edge is lower by 2.5 %
    np.testing.assert_allclose([r.value for r in rows_of(report, "crossfall")], -2.5, atol=1e-6)
    np.testing.assert_allclose([r.value for r in rows_of(report, "grade")], 2.0, atol=1e-6)
    np.testing.assert_allclose([r.value for r in rows_of(report, "curvature")], 0.0, atol=1e-9)
    full, dropped = rows_of(report, "upstand", line="top"), rows_of(report, "upstand", line="dropped")
    np.testing.assert_allclose([r.value for r in full], 0.12 - 0.0025, atol=1e-6)
    assert {r.side for r in dropped} == {"right"} and abs(dropped[3].value - 0.0225) < 1e-6
    low = rows_of(report, "top_height", "min", line="rail a")
    assert {r.verdict for r in low} == {"below"} and abs(low[0].value - (0.68 - 0.0125)) < 1e-6
    assert {r.verdict for r in rows_of(report, "top_height", "min", line="rail b")} == {"ok"}
    assert [(r.from_m, r.value) for r in rows_of(report, "gap", "sum")] == [(40.0, 20.0)]
    np.testing.assert_allclose([r.value for r in rows_of(report, "offset_from_line")], 1.0, atol=1e-6)


def test_a_bend_has_its_own_numbers():
    """Crossings of chords of 2 m with perpendiculars in a bend of 300 m: the sagitta is 1.7 mm."""
    report = chainage_report(road_lines(), own_routes(road_lines()), standard="uk")
    assert [axis.name for axis in report.axes] == ["dashed"]
    np.testing.assert_allclose(
        [r.value for r in rows_of(report, "lane_width", line="dashed | edge")], 3.5, atol=2e-3
    )
    np.testing.assert_allclose([r.value for r in rows_of(report, "carriageway_width")], 8.0, atol=2e-3)
    np.testing.assert_allclose([r.value for r in rows_of(report, "top_height", line="rail")], 0.75, atol=1e-3)
    np.testing.assert_allclose([r.value for r in rows_of(report, "upstand")], 0.12, atol=1e-3)
    found = rows_of(report, "clearance", "min")
    np.testing.assert_allclose([r.value for r in found if r.n > 10], 6.5, atol=0.02)
    assert {r.verdict for r in found} == {"ok"} and "CD 127" in found[0].limit_source
    np.testing.assert_allclose([abs(r.value) for r in rows_of(report, "curvature")], 1 / 300, rtol=0.05)


def test_what_is_bridged_is_unknown_and_never_a_number():
    lines, axis = straight(ROAD)
    whole = chainage_report(lines, [axis], standard="us")
    s = np.linalg.norm(lines.xyz[:, :2] - [500_000, 5_400_000], axis=1)
    hidden = (lines.id[lines.line_of_vertex] == "rail a") & (s > 8) & (s < 32)
    report = chainage_report(lines.with_columns(bridged=hidden), [axis], standard="us")
    rails = rows_of(report, "top_height", "mean", line="rail a")
    assert [r.from_m for r in rails if r.value is None] == [10.0, 20.0]
    assert {(r.verdict, r.sigma, r.n, r.measured_share) for r in rails if r.value is None} == {
        ("unknown", None, 0, 0.0)
    }
    partly = next(r for r in rails if r.from_m == 30.0)
    assert 0 < partly.measured_share < 1 and partly.value is not None
    # Nothing else has changed
    assert [r for r in report.rows if r.line != "rail a"] == [r for r in whole.rows if r.line != "rail a"]


@pytest.mark.parametrize(("y", "widths"), [(-3.3, {7.5}), (-2.8, {None}), (-1.9, {7.5})])
def test_the_carriageway_is_unknown_where_paint_may_be_its_end(y, widths):
    """Between a double line and a cycle lane is what pale stones of a flush kerb look like."""
    table = [
        ("edge", "lane_marking", 3.5, 0.0, "solid", (0, 100)),
        ("other edge", "lane_marking", -2.0, 0.0, "solid", (0, 100)),
        ("middle", "lane_marking", 0.0, 0.0, "dashed", (0, 100)),
        ("stones", "lane_marking", y, 0.0, "solid", (0, 100)),
        ("right", "road_boundary", -3.5, 0.0, "", (0, 100)),
        ("left", "road_boundary", 4.0, 0.0, "", (0, 100)),
    ]
    lines, axis = straight(table)
    report = chainage_report(lines, [axis], standard="us")
    found = rows_of(report, "carriageway_width")
    assert {row.value if row.value is None else round(row.value, 6) for row in found} == widths
    assert len(found) == 11


@pytest.mark.parametrize(
    ("offsets", "width"),
    [
        # Stones outside the edge line on the left, and on the right
        ((-3.0, 0.0, 2.8, 3.5), None),
        ((-3.0, -2.3, 0.0, 3.5), None),
        # On the footway, behind the boundary: the paint up to it is what counts
        ((-5.0, -4.2, -3.0, 0.0, 3.5), 7.5),
        ((-3.0, 0.0, 3.5, 4.7, 5.5), 7.5),
        # A wide double line in the middle: beside nothing else, and about the axis with one edge line
        ((0.5, 1.3), 7.5),
        ((-0.4, 0.4), 7.5),
        ((-3.0, -0.4, 0.4), 7.5),
        # An edge line and stones, and nothing else was found
        ((2.0, 2.8), None),
        # The axis along the edge line
        ((-0.8, 0.01, 3.0), None),
    ],
)
def test_lines_in_the_middle_or_behind_the_boundary_are_no_ends_of_the_carriageway(offsets, width):
    paint = [(f"paint {y}", "lane_marking", y, 0.0, "solid", (0, 100)) for y in offsets]
    ends = [
        ("right", "road_boundary", -3.5, 0.0, "", (0, 100)),
        ("left", "road_boundary", 4.0, 0.0, "", (0, 100)),
    ]
    lines, axis = straight([*ends, *paint])
    found = rows_of(chainage_report(lines, [axis], standard="us"), "carriageway_width")
    assert {row.value if row.value is None else round(row.value, 6) for row in found} == {width}


def test_a_boundary_behind_another_is_no_end_where_that_was_not_found():
    ends = [
        (name, "road_boundary", y, 0.0, "", (0, s)) for name, y, s in (("near", 4.0, 48), ("far", 5.6, 100))
    ]
    lines, axis = straight([*ROAD[:3], *ends])
    found = rows_of(chainage_report(lines, [axis], every_m=50.0), "carriageway_width")
    assert [row.value for row in found[:2]] == [pytest.approx(7.4), None]


@pytest.mark.parametrize(("measured_m", "widths"), [(6.0, {7.0}), (30.0, {7.0, 7.8})])
def test_a_boundary_that_was_carried_to_another_edge_is_no_end_of_the_carriageway(measured_m, widths):
    """It was carried over 20 m under grass, and then measured 0.8 m farther away: for less than that, or for more."""
    lines, axis = straight([("right", "road_boundary", -3.5, 0.0, "", (0, 100)), *ROAD[1:2]])
    s = np.arange(0.0, 50.1 + measured_m, 2.0)
    table = [("left", "road_boundary", 3.5, 0.0, "", (0.0, float(s[-1])))]
    left = straight(table)[0]
    share = np.clip((s - 30.0) / 20.0, 0.0, 1.0)
    xyz = left.xyz.copy()
    xyz[:, :2] += (0.8 * share)[:, None] * axis.left[0]
    left = left.with_columns(xyz=xyz, bridged=(s >= 30.0) & (s < 50.0))
    report = chainage_report(LineSet.concatenate([lines, left]), [axis], every_m=2.0)
    found = {round(r.value, 1) for r in rows_of(report, "carriageway_width") if r.value is not None}
    assert found == widths


def test_a_rail_has_no_offset_from_the_line_of_a_lane():
    lines, axis = straight(ROAD)
    for role, value in (("edge", 1.0), ("", 1.0), ("lane", None), ("centre", None)):
        named = lines.with_columns(role=np.where(lines.id == "edge", role, ""))
        found = rows_of(chainage_report(named, [axis], standard="us"), "offset_from_line")
        assert found and {r.value if r.value is None else round(r.value, 6) for r in found} == {value}
    # Where the edge line was not found the nearest one is that of a lane, whatever its role
    lines, axis = straight([("edge", "lane_marking", 3.5, 0.0, "solid", (0, 30)), *ROAD[1:]])
    found = rows_of(chainage_report(lines, [axis]), "offset_from_line", line="rail a")
    assert [r.value if r.value is None else round(r.value, 6) for r in found] == [1.0, 1.0, 1.0, 1.0, None]


@pytest.mark.parametrize("form", ["edge", "kerb"])
def test_a_lane_has_no_width_where_its_edge_line_may_be_missing(form):
    road = [*ROAD[:4], ("outer", "lane_marking", -2.9, 0.0, "solid", (0, 40))]
    lines, axis = straight(road)
    lines = lines.with_columns(
        form=np.array(["", "", form, form, ""]), role=np.array(["edge", "centre", "", "", "edge"])
    )
    widths = {
        r.line: r for r in rows_of(chainage_report(lines, [axis], every_m=100.0), "lane_width", from_m=0.0)
    }
    # Beyond 40 m no line lies between the middle and the end of the carriageway: as wide as before it is not
    np.testing.assert_allclose(widths["outer | middle"].value, 2.9, atol=1e-6)
    assert widths["right | middle"].value is None and widths["right | middle"].measured_share == 0.0
    np.testing.assert_allclose(widths["middle | edge"].value, 3.5, atol=1e-6)
    # Without any edge line on this side there is none at a kerb
    lines, axis = straight(ROAD[:4])
    lines = lines.with_columns(form=np.array(["", "", form, form]))
    (row,) = rows_of(
        chainage_report(lines, [axis], every_m=100.0), "lane_width", line="right | middle", from_m=0.0
    )
    assert row.value == (None if form == "edge" else pytest.approx(3.4, abs=1e-6))


def test_a_lane_has_no_width_where_it_may_end_at_another_line():
    # Up to one stripe of a double line, where the nearer one was not found
    road = [*ROAD[:4], ("stripe", "lane_marking", -0.24, 0.0, "solid", (0, 40))]
    lines, axis = straight(road)
    lines = lines.with_columns(form=np.array(["", "", "kerb", "kerb", ""]))
    found = rows_of(chainage_report(lines, [axis], every_m=50.0), "lane_width")
    known = {(r.line, r.from_m): r.value for r in found if r.from_m < 100.0}
    assert known["right | stripe", 0.0] == pytest.approx(3.16) and known["right | middle", 50.0] is None
    assert known["middle | edge", 50.0] == pytest.approx(3.5)
    # Across the road, from the line along one of its edges to the other edge
    for y, far, near, width in (
        (3.5, "edge", "edge", None),
        (3.5, "kerb", "edge", 5.5),
        # A parking strip beside a kerb is wider than 1.2 m
        (3.5, "edge", "kerb", None),
        (1.7, "edge", "kerb", 3.7),
        (1.7, "edge", "edge", 3.7),
    ):
        line = ("edge", "lane_marking", y, 0.0, "solid", (0, 100))
        lines, axis = straight([line, ("right", *ROAD[2][1:2], -2.0, *ROAD[2][3:]), ROAD[3]])
        lines = lines.with_columns(form=np.array(["", far, near]))
        found = rows_of(chainage_report(lines, [axis]), "lane_width", line="right | edge")
        assert {r.value if r.value is None else round(r.value, 6) for r in found} == {width}


def test_a_wire_across_the_road_is_over_both_lanes():
    lines, axis = straight(ROAD[:4])
    place = axis.xyz[50]
    left = np.append(axis.left[50], 0.0)
    ends = [place + 12 * left + [0, 0, 6.0], place - 12 * left + [0, 0, 4.8]]
    wire = LineSet.from_lines([ends], kind=["cable"], id=["w"], crs=lines.crs, sigma_z_m=np.full(2, 0.01))
    report = chainage_report(LineSet.concatenate([lines, wire]), [axis], standard="us")
    found = {r.line: r for r in rows_of(report, "clearance", "min")}
    assert set(found) == {"w over right | middle", "w over middle | edge"}
    # It slopes, and is lowest over the ends of the lanes
    np.testing.assert_allclose(found["w over right | middle"].value, 5.4 - 3.4 * 0.05, atol=0.003)
    np.testing.assert_allclose(found["w over middle | edge"].value, 5.4, atol=0.003)
    assert {r.from_m for r in found.values()} == {50.0}


def test_an_upstand_is_less_sure_where_the_kerb_begins_to_drop():
    lines, axis = straight([*ROAD[:3], ROAD[3], ROAD[4]])
    top = lines.xyz[lines.line_of_vertex == 4]
    drop_m = np.interp(np.arange(51) * 2.0, [0, 40, 42, 58, 60, 100], [0, 0, 0.12, 0.12, 0, 0])
    xyz = lines.xyz.copy()
    xyz[lines.line_of_vertex == 4] = top - drop_m[:, None] * [0, 0, 1]
    rows = rows_of(chainage_report(lines.with_columns(xyz=xyz), [axis], every_m=2.0), "upstand")
    sigma = {r.from_m: r.sigma for r in rows}
    # As sure as both lines, but where it begins and ends to drop: by a quarter of the step in its slope over a metre
    assert sigma[20.0] == sigma[50.0] == pytest.approx(np.hypot(0.008, 0.008))
    unseen = 0.25 * np.sqrt(0.06**2 - 6 * (0.008**2 + 0.008**2))
    assert sigma[40.0] == pytest.approx(np.hypot(sigma[50.0], unseen), rel=0.01)


def test_lines_across_are_no_bounds():
    lines, axis = straight(ROAD[:4])
    stop = LineSet.from_lines([np.stack([axis.xyz[50] - [1.7, 0, 0], axis.xyz[50] + [1.7, 0.1, 0]])], kind=["lane_marking"],
                              id=["stop"], crs=lines.crs)  # fmt: skip
    report = chainage_report(LineSet.concatenate([lines, stop]), [axis])
    assert not [r for r in report.rows if "stop" in r.line]


def test_crossings_are_where_they_are():
    lines, axis = straight(ROAD)
    cuts = cross_cuts(lines, axis)
    offsets = {"edge": 3.5, "middle": 0.0, "right": -3.4}
    for name, offset in offsets.items():
        own = cuts.take(np.flatnonzero(lines.id[cuts.line] == name))
        assert len(own) == len(axis.station_m)
        np.testing.assert_allclose(own.offset_m, offset, atol=1e-9)
        np.testing.assert_allclose(own.along_m, axis.station_m, atol=1e-9)
        assert np.array_equal(own.station, np.arange(len(own)))


def test_routes():
    lines, axis = straight(ROAD)
    assert [a.name for a in own_routes(lines)] == ["edge"]
    far = lines.with_columns(xyz=lines.xyz + np.array([500.0, 0, 0]), id=np.char.add("far ", lines.id))
    assert [a.name for a in own_routes(LineSet.concatenate([lines, far]))] == ["edge", "far edge"]
    with pytest.raises(InputError, match="no marking, boundary or rail of at least 30 m"):
        own_routes(lines.take([]))
    flat = LineSet.from_lines(
        [np.column_stack([axis.xyz[:, :2], np.full(len(axis.xyz), np.nan)])], id=["A 5"]
    )
    (route,) = routes_of_file(flat)
    assert route.name == "A 5" and np.isfinite(route.xyz).all()
    standing = np.repeat(axis.xyz, 3, axis=0)
    np.testing.assert_allclose(route_of_path(standing)[0].xyz, axis.xyz, atol=1e-6)


@pytest.mark.parametrize(("kwargs", "words"), [({"standard": "mars"}, "unknown standard 'mars'"), ({"every_m": 0.0}, "at least 1 m"), ({"every_m": np.nan}, "at least 1 m")])  # fmt: skip
def test_parameters_that_are_refused(kwargs, words):
    lines, axis = straight(ROAD)
    with pytest.raises(UsageError, match=words):
        chainage_report(lines, [axis], **kwargs)


@pytest.mark.parametrize("standard", LIMITS)
def test_every_limit_has_a_source_and_a_row(standard):
    lines, axis = straight(ROAD)
    report = chainage_report(lines, [axis], standard=standard)
    for limit in LIMITS[standard]:
        assert limit.source and (limit.least is None or limit.most is None or limit.least < limit.most)
    assert any(row.limit_source for row in report.rows)


def in_order(rows):
    """Return rows of any table in one order, an unknown value as infinity."""
    return sorted(
        (float(r["from_m"]), r["quantity"], r["statistic"], r["line"] or "",
         np.inf if r["value"] in (None, "") else float(r["value"]))
        for r in rows
    )  # fmt: skip


def test_all_tables_hold_the_same_rows(linework, tmp_path):
    write_lines(road_lines(), tmp_path / "road.gpkg")
    for suffix in ("csv", "xlsx", "gpkg", "html"):
        found = linework("report", tmp_path / "road.gpkg", "-o", tmp_path / f"r.{suffix}", "--standard", "uk")
        assert found.code == 0, found.stderr
    rows = list(csv.DictReader(io.StringIO((tmp_path / "r.csv").read_text())))
    book = openpyxl.load_workbook(tmp_path / "r.xlsx")
    names = [cell.value for cell in book.worksheets[0][1]]
    sheets = [
        dict(zip(names, row, strict=True))
        for sheet in book
        for row in sheet.iter_rows(min_row=2, values_only=True)
    ]
    with sqlite3.connect(tmp_path / "r.gpkg") as db:
        stored = db.execute(f"SELECT {', '.join(names)} FROM chainage").fetchall()
    db.close()
    key = [(r["from_m"], r["quantity"], r["statistic"], r["line"], r["value"]) for r in rows]
    assert len(set(key)) == len(rows) == len(stored) == len(sheets) > 100
    stored_rows = [dict(zip(names, row, strict=True)) for row in stored]
    assert in_order(sheets) == in_order(stored_rows) == in_order(rows)
    page = (tmp_path / "r.html").read_text()
    assert page.count("data:image/png;base64,") >= 2 and "http" not in page.replace("http-equiv", "")


def test_the_same_lines_give_the_same_bytes(linework, tmp_path):
    write_lines(road_lines(), tmp_path / "road.gpkg")
    for suffix in ("xlsx", "gpkg", "html"):
        for name in ("a", "b"):
            (tmp_path / name).mkdir(exist_ok=True)
            assert linework("report", tmp_path / "road.gpkg", "-o", tmp_path / name / f"r.{suffix}").code == 0
        assert (tmp_path / f"a/r.{suffix}").read_bytes() == (tmp_path / f"b/r.{suffix}").read_bytes()


def test_commands_that_are_refused(linework, tmp_path):
    write_lines(road_lines(), tmp_path / "road.gpkg")
    assert (
        "cannot write '.pdf' reports"
        in linework("report", tmp_path / "road.gpkg", "-o", tmp_path / "r.pdf").line
    )
    both = ("--route", tmp_path / "road.gpkg", "--trajectory", tmp_path / "path.csv")
    assert linework("report", tmp_path / "road.gpkg", "-o", tmp_path / "r.csv", *both).code == 2
    (tmp_path / "path.csv").write_text("time_s,easting_m,northing_m,height_m\n" + "\n".join(
        f"{i},{512_345.6 + 5 * i},{5_403_210.9 + i * i * 0.04},101" for i in range(10)))  # fmt: skip
    found = linework("report", tmp_path / "road.gpkg", "-o", tmp_path / "r.csv", *both[2:])
    assert found.code == 0 and "path.csv" in found.stdout
    found = linework("report", tmp_path / "road.gpkg", "-o", tmp_path / "q.csv", *both[:2])
    assert found.code == 0
