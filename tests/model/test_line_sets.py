"""LineSet as a container: choosing, comparing, describing."""

import copy
import html.parser
import pickle
import warnings

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from tests.scenes.drawing_scenes import some_lines
from tests.scenes.effort import examples
from tests.scenes.line_sets import line_sets

from linework.errors import CrsError, LineworkError
from linework.model.lines import KINDS, LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.lineset.line import Line
from linework.model.lineset.report import Report

REPORT = Report(source="A7", kinds=("cable",))


def test_a_number_chooses_a_line_with_all_that_is_known_of_it():
    lines = some_lines(6)
    for i, line in enumerate(lines):
        for other in (lines[i], lines[i - 6], lines[np.int64(i)]):
            assert isinstance(other, Line)
            assert other == line
        own = slice(lines.offsets[i], lines.offsets[i + 1])
        np.testing.assert_array_equal(line.xyz, lines.xyz[own])
        for name in VERTEX_COLUMNS:
            np.testing.assert_array_equal(getattr(line, name), getattr(lines, name)[own])
        for name in LINE_COLUMNS:
            value = getattr(line, name)
            assert type(value) in (str, float, bool)
            np.testing.assert_equal(value, getattr(lines, name)[i])
        assert (line.length_m, line.bridged_m) == (lines.length_m[i], lines.bridged_m[i])
        assert (len(line), line.crs) == (len(line.xyz), lines.crs)
    assert i == len(lines) - 1
    for wrong in (6, -7):
        with pytest.raises(IndexError, match=f"line {wrong} of 6"):
            lines[wrong]


def test_a_line_cannot_be_changed():
    line = some_lines()[0]
    for name in ("kind", "xyz", "length_m"):
        with pytest.raises(AttributeError):
            setattr(line, name, 3)
    with pytest.raises(ValueError, match="read-only"):
        line.xyz[0, 0] = 3.0


def test_a_kind_chooses_its_lines_and_a_wrong_one_is_named():
    lines = some_lines(6).with_columns(kind=["cable", "wall", "cable", "guardrail", "wall", "cable"])
    assert lines["cable"] == lines[[0, 2, 5]]
    assert lines["wall"] == lines[[1, 4]]
    assert lines.kinds == ("guardrail", "cable", "wall")
    assert len(lines["barrier"]) == 0
    with pytest.raises(KeyError) as caught:
        lines["gardrail"]
    assert isinstance(caught.value, LineworkError)
    assert (
        str(caught.value)
        == "unknown kind 'gardrail'. Did you mean guardrail? These lines hold guardrail, cable, wall."
    )
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_slices_masks_and_index_arrays_choose_sets():
    lines = some_lines(6)
    numbers = np.arange(6)
    long = lines.length_m > np.median(lines.length_m)
    for index in (
        slice(1, 4),
        slice(None, None, -1),
        slice(9, 12),
        long,
        long.tolist(),
        [3, 1],
        np.array([-1, 0]),
        [],
    ):
        chosen = lines[index]
        assert isinstance(chosen, LineSet)
        expected = numbers[np.zeros(0, int) if isinstance(index, list) and not index else index]
        assert chosen == lines.take(expected)
        assert [line.id for line in chosen] == lines.id[expected].tolist()
    for wrong in (long[:-1], [6], [-7]):
        with pytest.raises(IndexError):
            lines[wrong]
    for wrong in (1.5, [0.5], True, None, (1, 2), np.zeros((2, 2), int)):
        with pytest.raises((TypeError, IndexError)):
            lines[wrong]


def test_equal_sets_have_equal_columns_and_nan_equals_nan():
    lines = some_lines().with_columns(report=REPORT)
    assert (
        lines == copy.deepcopy(lines) == pickle.loads(pickle.dumps(lines)) == lines.with_columns(report=None)
    )
    assert np.isnan(lines.width_m).any()
    for name in VERTEX_COLUMNS + LINE_COLUMNS:
        changed = getattr(lines, name).copy()
        changed[0] = {"f": 0.123, "b": not changed[0], "U": "x"}[changed.dtype.kind]
        assert lines != lines.with_columns(**{name: changed}), name
    assert lines != lines.with_columns(xyz=lines.xyz + 1)
    assert lines != lines.with_crs(25832)
    assert lines != lines[:-1]
    assert lines != "lines"
    with pytest.raises(TypeError, match="unhashable"):
        hash(lines)
    # Two lines of two vertices, or one of four
    assert LineSet.from_lines([np.eye(3), np.eye(3)]) != LineSet.from_lines([np.vstack([np.eye(3)] * 2)])


def test_the_report_stays_with_the_lines():
    lines = some_lines().with_columns(report=REPORT)
    for kept in (
        lines[:2],
        lines["cable"],
        lines.take([1]),
        lines.with_columns(note="x"),
        lines.with_crs(25832),
        lines[0].as_set(),
    ):
        assert kept.report is REPORT
    assert LineSet.concatenate([lines, lines[:1]]).report is REPORT
    assert LineSet.concatenate([lines, some_lines()]).report is None
    assert LineSet.concatenate([]).report is None


def test_crs_are_texts_codes_or_objects():
    lines = some_lines()
    wkt = pyproj.CRS("EPSG:25832+7837").to_wkt("WKT2_2019")
    for crs in ("EPSG:25832+7837", pyproj.CRS("EPSG:25832+7837"), wkt):
        assert lines.with_crs(crs).crs == LineSet.empty(crs).crs == LineSet.from_lines([], crs=crs).crs == wkt
        np.testing.assert_array_equal(lines.with_crs(crs).xyz, lines.xyz)
    assert lines.with_crs(25832) == lines.with_crs("epsg:25832") != lines
    for wrong in (4326, "EPSG:999999", 3.5, None, "utm"):
        with pytest.raises(CrsError, match="crs: "):
            lines.with_crs(wrong)
        with pytest.raises(CrsError, match="crs: "):
            LineSet.from_lines([], crs=wrong)


def test_bounds_are_those_of_the_vertices():
    lines = some_lines()
    west, south, east, north = lines.bounds
    assert (west, south) == tuple(lines.xyz[:, :2].min(axis=0))
    assert (east, north) == tuple(lines.xyz[:, :2].max(axis=0))
    with pytest.raises(ValueError, match="no lines: no extent"):
        LineSet.empty().bounds  # noqa: B018


def test_one_value_stands_for_all_rows():
    lines = LineSet.from_lines([np.eye(3), np.eye(3)], kind="cable", sigma_xy_m=0.01, double=True)
    assert lines.kind.tolist() == ["cable", "cable"]
    assert lines.sigma_xy_m.tolist() == [0.01] * 6
    assert lines.with_columns(note="ü").note.tolist() == ["ü", "ü"]
    assert lines.with_columns(observed=False).observed.sum() == 0


class _Balanced(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.paths = [], []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        assert tag == "path"
        self.paths.append(dict(attrs))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def page(text: str) -> _Balanced:
    parser = _Balanced()
    parser.feed(text)
    assert not parser.open
    return parser


@settings(max_examples=examples(60), deadline=None)
@given(line_sets(most=15, fewest_vertices=0))
def test_any_set_can_be_shown_in_twelve_lines(lines):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(repr(lines).split("\n")) <= 12
        assert max(map(len, repr(lines).split("\n"))) < 140
        page(lines._repr_html_())
    for line in lines:
        assert len(repr(line)) < 200
    assert lines == lines[:] == lines[np.arange(len(lines))]


def test_what_is_shown_is_what_is_there():
    found = some_lines(60)
    kind = [f"<kind {i % 12}>" if i % 12 else "guardrail" for i in range(60)]
    lines = found.with_columns(kind=kind).with_crs("EPSG:25832+7837")
    text = repr(lines)
    assert text.startswith(f"LineSet: 60 lines, {lines.length_m.sum():,.1f} m\n")
    assert f"  guardrail  5 lines  {lines['guardrail'].length_m.sum():,.1f} m" in text
    assert "5 more kinds: 25 lines" in text
    assert "ETRS89 / UTM zone 32N + DHHN2016 height (EPSG:25832+7837)" in text
    assert f"bridged: {100 * lines.bridged_m.sum() / lines.length_m.sum():.1f} %" in text
    drawn = page(lines._repr_html_())
    assert "<kind 1>" not in lines._repr_html_()
    # Measured and bridged stretches of every kind
    assert len(drawn.paths) == 24
    assert sum("stroke-dasharray" in path for path in drawn.paths) == 12


def test_a_picture_of_many_lines_stays_small():
    walk = np.cumsum(np.random.default_rng(1).normal(size=(100_000, 3)), axis=0)
    for pieces in ([walk], np.split(walk, 20_000)):
        lines = LineSet.from_lines(pieces, kind="cable")
        assert 5_000 < len(lines._repr_html_()) < 150_000
    assert "<svg" not in LineSet.empty()._repr_html_()
    assert "<svg" not in LineSet.from_lines([np.full((3, 3), np.nan)])._repr_html_()


def test_a_plot_shows_each_kind_to_scale_and_bridged_stretches_dashed():
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib.figure import Figure

    lines = some_lines(6)
    ax = lines.plot(Figure().subplots())
    assert ax.get_aspect() == 1.0
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == [f"{kind} ({n} line{'s' * (n > 1)})" for kind in lines.kinds for n in [len(lines[kind])]]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("east [m]", "north [m]")
    west, south, east, north = lines.bounds
    assert ax.get_xlim()[0] <= west < east <= ax.get_xlim()[1]
    assert ax.get_ylim()[0] <= south < north <= ax.get_ylim()[1]
    drawn = [(c.get_linestyle()[0][1], segment) for c in ax.collections for segment in c.get_segments()]
    measured_m, bridged_m = (
        sum(np.hypot(*np.diff(s, axis=0).T).sum() for dash, s in drawn if (dash is None) == solid)
        for solid in (True, False)
    )
    plan = lines.with_columns(kind="guardrail")
    assert bridged_m == pytest.approx(plan.bridged_m.sum())
    assert measured_m + bridged_m == pytest.approx(plan.length_m.sum())
    assert LineSet.empty().plot(Figure().subplots()).get_legend() is None
    widths = {c.get_linewidth()[0] for c in lines.plot(Figure().subplots(), linewidths=3).collections}
    assert widths == {3}


def test_kinds_are_in_the_order_of_the_layers():
    assert LineSet.from_lines([np.eye(3)] * len(KINDS), kind=KINDS[::-1]).kinds == KINDS
    assert LineSet.empty().kinds == ()
