"""What a report draws of roads: the bright ground, plans, cuts across kerbs and markings."""

import numpy as np
import pytest

from linework.evaluation.report.cuts import (
    kerb_cuts,
    kerb_figure,
    marking_cuts,
    marking_figure,
    measured_chainages,
    station_at,
)
from linework.evaluation.report.page import ReportContent, report_html
from linework.evaluation.report.plan import PlanView, close_up_figure, plan_figure
from linework.evaluation.report.scores_figure import plot_png
from linework.evaluation.report.tables import kinds_table
from linework.imaging.brightness import brightness_picture, near_ground
from linework.model.grid import holds
from linework.model.lines import LineSet
from linework.model.points import Points

ORIGIN = np.array([691_000.0, 5_336_000.0, 500.0])
SLOPE = 0.05


@pytest.fixture(scope="module")
def street():
    """A road of 100 m to the east that climbs, its kerb of 12 cm at y = 4 to the north, a marking at y = 1."""
    rng = np.random.default_rng(7)
    x, y = rng.uniform(0, 100, 150_000), rng.uniform(-4, 8, 150_000)
    z = SLOPE * x + np.where(y > 4.0, 0.12, 0.0)
    intensity = np.where(np.abs(y - 1.0) < 0.06, 200.0, 50.0) + rng.normal(0, 3, len(x))
    return Points(np.stack([x, y, z], axis=1) + ORIGIN, intensity=intensity.astype(np.float32))


def along(y, up=0.0, x0=0.0, x1=100.0):
    x = np.linspace(x0, x1, 101)
    return np.stack([x, np.full_like(x, y), SLOPE * x + up], axis=1) + ORIGIN


@pytest.fixture(scope="module")
def lines():
    return LineSet.from_lines(
        [along(1.01), along(-3.0), along(-3.0, x0=40, x1=43), along(4.0), along(4.02, 0.12)],
        kind=["lane_marking", "lane_marking", "lane_marking_dash", "road_boundary", "kerb_top"],
        pattern=["solid", "dashed", "dashed", "", ""],
        form=["", "", "", "kerb", "kerb"],
        width_m=[0.12, 0.12, 0.12, np.nan, np.nan],
        height_m=[np.nan, np.nan, np.nan, 0.12, 0.12],
    )


def reader(points):
    return lambda bounds: points.take(holds(bounds, points.xyz))


def test_the_ground_is_what_is_lowest_but_for_strays():
    rng = np.random.default_rng(3)
    ground = np.stack([*rng.uniform(0, 10, (2, 20_000)), rng.normal(0, 0.01, 20_000)], axis=1)
    roof, kerb, strays = (
        ground[part] + np.array([0.0, 0.0, up])
        for part, up in ((slice(0, 500), 3.0), (slice(500, 600), 0.15), (slice(600, 630), -2.0))
    )
    is_low = near_ground(np.concatenate([ground, roof, kerb, strays]) + ORIGIN)
    assert is_low[:20_000].all()
    assert not is_low[20_000:20_500].any()
    assert is_low[20_500:].all()
    assert len(near_ground(np.zeros((0, 3)))) == 0


def test_paint_is_as_bright_near_and_far(street):
    xy = street.xyz[:, :2] - ORIGIN[:2]
    # A scanner sees a tenth at the far end
    fading = street.intensity * (1.0 - 0.9 * xy[:, 0] / 100.0)
    picture = brightness_picture(xy, fading, ((0.0, 100.0), (-4.0, 8.0)), 0.12)
    assert picture.shape == (100, 833)
    paint, asphalt = picture[41], picture[20]
    for part in (slice(20, 300), slice(500, 800)):
        assert np.nanmean(paint[part]) > 0.8
        assert np.nanmean(asphalt[part]) == pytest.approx(0.3, abs=0.05)
    away = brightness_picture(xy, fading, ((200.0, 210.0), (0.0, 5.0)), 0.1)
    assert np.isnan(away).all()


def test_noise_is_not_made_to_look_like_paint():
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 20, (50_000, 2))
    picture = brightness_picture(xy, rng.normal(100, 2, len(xy)), ((0.0, 20.0), (0.0, 20.0)), 0.2)
    assert np.nanmax(picture) < 0.5


def test_a_view_reads_what_it_shows():
    turn = np.radians(30.0)
    places = ORIGIN[:2] + np.outer(np.linspace(0, 100, 50), [np.cos(turn), np.sin(turn)])
    view = PlanView.of(places)
    assert np.ptp(view.in_plan(places)[:, 1]) == pytest.approx(0, abs=1e-6)
    middle = view.in_plan(places[25:26])[0]
    bounds = view.bounds(((middle[0] - 1, middle[0] + 1), (middle[1] - 1, middle[1] + 1)))
    half = np.cos(turn) + np.sin(turn)
    assert bounds.width_m == pytest.approx(2 * half)
    assert (bounds.west + bounds.east) / 2 == pytest.approx(places[25, 0])
    assert (bounds.south + bounds.north) / 2 == pytest.approx(places[25, 1])


def test_a_kerb_is_cut_where_it_was_measured(street, lines):
    for reverse in (False, True):
        drawn = lines
        if reverse:
            drawn = lines.with_columns(xyz=np.concatenate([lines[i].xyz[::-1] for i in range(len(lines))]))
        cuts = kerb_cuts(drawn, reader(street), lines)
        assert len(cuts) == 3
        for cut in cuts:
            assert "kerb" in cut.title
            assert "step 12 cm" in cut.title
            assert cut.found == pytest.approx(np.zeros((1, 2)), abs=1e-6)
            assert cut.truth == pytest.approx(np.zeros((1, 2)), abs=1e-6)
            # The footway is to the right, whichever way the line was drawn; the road's own slope is taken out
            assert cut.found_top == pytest.approx(np.array([[0.02, 0.12]]), abs=1e-6)
            across, up = cut.points.T
            assert len(across) > 20
            assert np.abs(up - np.where(across > 0, 0.12, 0.0)).max() < 1e-6
            assert np.abs(across).max() <= 0.5


def test_a_boundary_without_a_kerb_is_cut_where_there_is_no_other(street, lines):
    edge = LineSet.from_lines([along(-3.5)], kind=["road_boundary"], form=["edge"])
    assert kerb_cuts(edge, reader(street), None)[0].title == "edge, 17 m from its start"
    both = LineSet.concatenate([edge, lines.take([3]).with_columns(xyz=lines[3].xyz)])
    assert kerb_cuts(both, reader(street), None)[0].title.startswith("kerb")
    assert kerb_cuts(lines["lane_marking"], reader(street), None) == ()
    hidden = edge.with_columns(bridged=np.ones(len(edge.xyz), dtype=bool))
    assert kerb_cuts(hidden, reader(street), None) == ()


def test_a_marking_stands_out_of_its_cut(street, lines):
    solid, dash = marking_cuts(lines, reader(street), lines)
    assert (solid.title, dash.title) == ("solid: 12 cm wide", "dash: 12 cm wide")
    assert solid.found[:, 0] == pytest.approx([0.0], abs=1e-6)
    assert solid.found_width_m.tolist() == [0.12]
    # Drawn to the east 1 cm beside the paint's middle, which is to the right
    on_paint = np.abs(solid.points[:, 0] - 0.01) < 0.05
    assert solid.intensity[on_paint].mean() > 150
    assert solid.intensity[np.abs(solid.points[:, 0]) > 0.1].mean() == pytest.approx(50, abs=2)
    # The dashed line itself is not in the cut, its dash is
    assert len(dash.found) == 1


def test_places_are_measured_ones():
    bridged = np.arange(101) % 100 > 10
    line = LineSet.from_lines([along(0.0)], kind=["road_boundary"], bridged=bridged)
    assert max(measured_chainages(line, 0, 3)) <= 10.0
    place = station_at(along(0.0), 50.0)
    assert place.slope == pytest.approx(SLOPE)
    assert (*place.along, *place.right) == pytest.approx((1, 0, 0, -1))


def test_pictures_are_the_same_twice_and_need_no_reference(street, lines):
    for draw in (
        lambda: plan_figure(lines, street),
        lambda: close_up_figure(lines, street, reader(street)),
        lambda: kerb_figure(kerb_cuts(lines, reader(street), None)),
        lambda: marking_figure(marking_cuts(lines, reader(street), None)),
    ):
        image = plot_png(draw())
        assert image.startswith(b"\x89PNG")
        assert image == plot_png(draw())
    short = street.take(street.xyz[:, 0] < ORIGIN[0] + 20.0)
    assert close_up_figure(LineSet.empty(), short, reader(short)) is None
    assert close_up_figure(lines, Points(np.zeros((0, 3))), reader(street)) is None


def test_what_was_missed_is_drawn_too(street, lines):
    places = []

    def points_in(bounds):
        places.append((bounds.west + bounds.east) / 2 - ORIGIN[0])
        return reader(street)(bounds)

    # One short line at the start of the road
    found = LineSet.from_lines([along(0.0, x1=5.0)], kind=["lane_marking"])
    assert plot_png(close_up_figure(found, street, points_in)).startswith(b"\x89PNG")
    assert sorted(places) == pytest.approx([100 / 6, 50, 500 / 6], abs=1.0)
    ax = plan_figure(found, street).axes[0]
    assert np.ptp(ax.get_xlim()) > 80


def test_the_page_has_all_of_them(street, lines):
    page = report_html(ReportContent(title="street", lines=lines, points=street))
    for title in ("Lines over the point cloud", "Close-ups", "Across the road boundary", "Across markings"):
        assert f"<h2>{title}</h2>" in page
    assert "intensity of the ground" in page
    dark = report_html(ReportContent(title="street", lines=lines, points=Points(street.xyz)))
    assert "Across markings" not in dark
    asked = []

    def points_in(bounds):
        asked.append(bounds)
        return reader(street)(bounds)

    assert report_html(ReportContent(title="street", lines=lines, points=street, points_in=points_in)) == page
    assert len(asked) == 3 + 3 + 2


def test_kinds_are_told_by_form_and_pattern(lines):
    rows = {row[0]: row for row in kinds_table(lines).rows}
    assert list(rows) == [
        "lane_marking", "- dashed", "- solid", "lane_marking_dash", "road_boundary", "kerb_top",
    ]  # fmt: skip
    assert rows["lane_marking"][1:3] == ("2", "200.0")
    assert rows["- solid"][1:3] == ("1", "100.0")
    assert rows["lane_marking"][7] == "12.0"
    assert rows["road_boundary"][8] == "0.12"
