"""References of real surveys are sane, and what scores against them says what is there."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from benchmarks._published_maps import argoverse_lines, bgt_lines
from benchmarks._real_worlds import judged, real_table, scored_survey
from benchmarks._references import FOLDER, Reference, data_folder, read_reference, read_references, within
from benchmarks.worlds import main
from tests.scenes.places import REAL

from linework.model.lines import KINDS, LineSet

PATHS = sorted(FOLDER.glob("*.toml"))
SQUARE = [[0, 0], [100, 0], [100, 100], [0, 100]]


def reference_of(lines: LineSet, **changes) -> Reference:
    told = {
        "name": "made-up", "file": "none.laz", "crs": "local", "kinds": ("lane_marking",), "absent": ("cable",),
        "accuracy_m": 0.05, "tolerance_m": 0.1, "measured": "made up", "lines": lines,
        "area": shapely.Polygon(SQUARE),
    }  # fmt: skip
    return Reference(**{**told, **changes})


def straight(
    y: float, kind: str = "lane_marking", x: tuple[float, float] = (0.0, 100.0), z: float = 1.0
) -> LineSet:
    return LineSet.from_lines([[[x[0], y, z], [x[1], y, z]]], kind=[kind])


def test_there_is_a_reference_for_every_folder_of_real_data():
    names = {path.stem for path in PATHS}
    for folder in (
        "here-a22",
        "kitti-drive0005",
        "als-roads-t",
        "als-roads-more",
        "av2",
        "amsterdam",
        "powerline",
        "kerbs-zurich",
        "forest",
        "stereo-ramp",
    ):
        assert any(name.startswith(folder) for name in names), folder


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_a_reference_says_what_is_true_where_and_how_it_was_measured(path):
    reference = read_reference(path, Path("nowhere"))
    assert set(reference.kinds) | set(reference.absent) <= set(KINDS)
    assert not set(reference.kinds) & set(reference.absent)
    assert set(reference.lines.kind.tolist()) <= set(reference.kinds)
    assert 0.0 < reference.accuracy_m <= reference.tolerance_m <= 0.5
    assert len(reference.measured) > 30
    assert reference.area.is_valid
    assert reference.hectares > 0.002
    assert np.isfinite(reference.lines.xyz).all()
    # A vertex that slipped shows as a corner
    for i in range(len(reference.lines)):
        line = reference.lines.xyz[reference.lines.offsets[i] : reference.lines.offsets[i + 1], :2]
        way = np.diff(line, axis=0)
        way = way[np.linalg.norm(way, axis=1) > 1.0]
        turn = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(way[:, 1], way[:, 0])))))
        assert (np.degrees(turn) < 25.0).all(), (
            f"{path.stem}: line {i} turns by {np.degrees(turn.max()):.0f} degrees"
        )


@pytest.mark.skipif(not REAL.is_dir(), reason="needs ../shared/data")
@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_the_lines_of_a_reference_lie_within_its_file(path):
    import laspy

    reference = read_reference(path, REAL)
    file = REAL / reference.file
    if file.suffix == ".log":
        points = np.loadtxt(file)
        low, high = points.min(axis=0), points.max(axis=0)
    elif file.is_dir():
        # Images: what they show lies within 30 m of the way of the camera; forward, left, up of the first
        way = np.loadtxt(file / "poses.txt")[:, [11, 3, 7]] * [1.0, -1.0, -1.0]
        low, high = way.min(axis=0) - 30.0, way.max(axis=0) + 30.0
    else:
        with laspy.open(file) as opened:
            low, high = opened.header.mins, opened.header.maxs
    assert not len(reference.lines) or (reference.lines.xyz[:, :2] >= low[:2] - 0.5).all()
    assert not len(reference.lines) or (reference.lines.xyz[:, :2] <= high[:2] + 0.5).all()
    assert shapely.box(*low[:2], *high[:2]).intersects(reference.area)
    assert reference.lines.xyz.size or not reference.kinds


def test_lines_are_judged_within_the_area_only():
    truth = straight(50.0)
    found = LineSet.concatenate(
        [straight(50.04, x=(-50.0, 60.0)), straight(20.0, x=(90.0, 140.0)), straight(-5.0)]
    )
    result = judged(found, reference_of(truth))
    (marking,) = result.scores
    assert marking.at.completeness == pytest.approx(0.6, abs=0.01)
    assert marking.extracted_m == pytest.approx(70.0)
    assert marking.at.correctness == pytest.approx(60.0 / 70.0, abs=0.01)
    assert marking.at.lateral.rmse_m == pytest.approx(0.04, abs=1e-6)


def test_what_nobody_could_tell_is_neither_right_nor_wrong():
    truth = straight(50.0)
    unjudged = shapely.box(40.0, 0.0, 100.0, 100.0)
    reference = reference_of(within(truth, shapely.box(0, 0, 40, 100)), unjudged=unjudged)
    found = LineSet.concatenate([straight(50.0), straight(60.0, x=(45.0, 95.0))])
    (marking,) = judged(found, reference).scores
    assert marking.at.completeness == pytest.approx(1.0)
    assert marking.at.correctness == pytest.approx(1.0)
    assert marking.reference_m == pytest.approx(40.0)


def test_lines_of_kinds_that_are_not_there_are_counted_in_metres():
    found = LineSet.concatenate([straight(30.0, "cable", z=9.0), straight(50.0)])
    result = judged(found, reference_of(straight(50.0)))
    assert result.absent_m == (("cable", pytest.approx(100.0)),)
    row = real_table([result]).rows[-1]
    # The square is one hectare
    assert row[1] == "none: cable"
    assert row[8] == "100"


def test_a_missing_survey_is_said():
    result = scored_survey(reference_of(straight(50.0)), Path("nowhere"))
    assert result.problem == "none.laz is not in nowhere"
    assert result.problem in real_table([result]).rows[0]


def test_a_missing_folder_of_data_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("LINEWORK_REAL_DATA", str(tmp_path / "none"))
    assert data_folder() == tmp_path / "none"
    with pytest.raises(SystemExit, match="no folder of real data"):
        main(["--surveys", "av2"])


def test_every_survey_that_is_missing_has_its_row(tmp_path, capsys):
    main(["--data", str(tmp_path), "--roads", "none"])
    told = capsys.readouterr().out
    for reference in read_references(tmp_path):
        assert f"{reference.name}: {reference.file} is not in {tmp_path.name}" in told


def test_published_maps_are_read_where_they_lie(tmp_path):
    city = tmp_path / "map.geojson"
    city.write_text(
        '{"features": ['
        '{"properties": {"kind": "lane_boundary", "mark": "SOLID_WHITE"}, "geometry": {"coordinates": [[0,0,1],[9,0,1]]}},'
        '{"properties": {"kind": "lane_boundary", "mark": "SOLID_WHITE"}, "geometry": {"coordinates": [[9,0,1],[0,0,1]]}},'
        '{"properties": {"kind": "lane_boundary", "mark": "NONE"}, "geometry": {"coordinates": [[0,3,1],[9,3,1]]}},'
        '{"properties": {"kind": "drivable_area_edge"}, "geometry": {"coordinates": [[0,6,1],[9,6,1]]}}]}',
        encoding="utf-8",
    )
    assert [kind for kind, _ in argoverse_lines(city)] == ["lane_marking", "road_boundary"]
    base = tmp_path / "bgt.csv"
    base.write_text(
        "bgt_type,polygon\n"
        'rijbaan_lokale_weg,"[[0, 0], [5, 0], [5, 4], [0, 4], [0, 0]]"\n'
        'rijbaan_lokale_weg,"[[5, 0], [9, 0], [9, 4], [5, 4], [5, 0]]"\n'
        'fietspad,"[[0, 4], [9, 4], [9, 6], [0, 6], [0, 4]]"\n',
        encoding="utf-8",
    )
    lines = bgt_lines(base)
    # The edge between the two carriageways bounds nothing
    assert sum(
        np.linalg.norm(np.diff(xyz[:, :2], axis=0), axis=1).sum() for _, xyz in lines
    ) == pytest.approx(26.0)
