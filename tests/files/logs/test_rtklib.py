"""RTKLIB's .pos: layouts, times, sigmas, quality, baselines, and what is refused."""

import datetime

import numpy as np
import pytest
from tests.scenes import gnss_files as made

from linework.crs import parse_crs
from linework.errors import InputError
from linework.files.geodetic import EarthFrame
from linework.files.logs.gnss import read_gnss
from linework.files.trajectories.read import TrajectorySettings, read_trajectory_content
from linework.model.logs import FIX_QUALITIES

PLAN = EarthFrame(crs=parse_crs("EPSG:25832"))
#: 2024-05-28 12:00:00 UTC as GPS seconds: 18 leap seconds since 1980
NOON = (datetime.datetime(2024, 5, 28, 12) - datetime.datetime(1980, 1, 6)).total_seconds() + 18
PLACES = np.array([[46.0, 9.0, 297.5], [46.0001, 8.9999, 298.25]])
SIGMA = np.array([[0.03, 0.02, 0.05], [0.04, 0.01, 0.06]])
BASE = (46.02, 8.97, 250.0)
TIMES = {
    ("GPST", "calendar"): [("2024/05/28", "12:00:18.000"), ("2024/05/28", "12:00:18.500")],
    ("UTC", "calendar"): [("2024/05/28", "12:00:00.000"), ("2024/05/28", "12:00:00.500")],
    ("GPST", "week"): [("2316", "216018.000"), ("2316", "216018.500")],
    ("UTC", "week"): [("2316", "216000.000"), ("2316", "216000.500")],
}


def pos_file(folder, layout="degrees", times=("GPST", "calendar"), *, places=PLACES, change=None, **options):
    text = made.pos(layout, TIMES[times], places, SIGMA, system=times[0], **options)
    (folder / "rover.pos").write_text(text if change is None else change(text))
    return folder / "rover.pos"


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("layout", ["degrees", "dms", "ecef", "baseline"])
def test_every_layout_and_time_gives_the_same_fixes(tmp_path, layout, times):
    content = read_gnss(pos_file(tmp_path, layout, times, base=BASE), PLAN)
    assert content.epoch == "gps"
    assert content.warnings == ()
    np.testing.assert_allclose(content.log.time_s, NOON + np.array([0, 0.5]), atol=1e-6)
    np.testing.assert_allclose(content.log.xyz[0, [0, 2]], [500000.0, 297.5], atol=1e-3)
    degrees = read_gnss(pos_file(tmp_path), PLAN).log
    np.testing.assert_allclose(content.log.xyz, degrees.xyz, atol=2e-4)
    np.testing.assert_allclose(content.log.sigma_m, SIGMA, atol=1e-4)  # east, north, up
    assert content.log.quality.tolist() == [1, 1]
    # As a ready trajectory, too
    path = read_trajectory_content(tmp_path / "rover.pos", TrajectorySettings(frame=PLAN))
    np.testing.assert_array_equal(path.trajectory.xyz, degrees.xyz)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_separators_south_and_west(tmp_path, separator):
    places = np.array([[-0.51, -0.25, 10.0], [-0.5101, -0.2501, 11.0]])
    frame = EarthFrame(crs=parse_crs("EPSG:32730"))
    (tmp_path / "a").mkdir()
    expected = read_gnss(pos_file(tmp_path / "a", places=places), frame).log.xyz

    def separated(text):
        lines = text.splitlines()
        return "\n".join(line if line.startswith("%") else separator.join(line.split()) for line in lines)

    for layout in ("degrees", "dms"):
        path = pos_file(tmp_path, layout, places=places, change=separated)
        np.testing.assert_allclose(read_gnss(path, frame).log.xyz, expected, atol=2e-4)


def test_quality_is_kept_and_solutions_without_a_position_are_left_out(tmp_path):
    for code in range(1, 8):
        assert read_gnss(pos_file(tmp_path, quality=code), PLAN).log.quality.tolist() == [code, code]
    assert FIX_QUALITIES[1:7] == ("fixed", "float", "sbas", "differential", "single", "ppp")
    one = pos_file(tmp_path, change=lambda text: text.replace("298.2500   1", "298.2500   0"))
    content = read_gnss(one, PLAN)
    assert len(content.log) == 1
    assert content.warnings == ("1 solutions without a position (Q = 0) left out",)
    with pytest.raises(InputError, match=r"none of the 2 solutions has a position \(Q = 0\)\. Compute"):
        read_gnss(pos_file(tmp_path, quality=0), PLAN)
    with pytest.raises(InputError, match="no usable rows"):
        read_gnss(pos_file(tmp_path, quality=9), PLAN)


def test_nmea_has_the_quality_of_gga(tmp_path):
    lines = [made.rmc("120000.00", "280524")]
    lines += [made.gga(f"12000{i}.00", 46.0, 9.0, 1.0, quality=q) for i, q in enumerate((4, 5, 2, 1))]
    (tmp_path / "g.nmea").write_text("\r\n".join(lines) + "\r\n")
    quality = read_gnss(tmp_path / "g.nmea", PLAN).log.quality
    assert [FIX_QUALITIES[q] for q in quality] == ["fixed", "float", "differential", "single"]


def test_a_baseline_needs_a_base(tmp_path):
    known = read_gnss(pos_file(tmp_path, "baseline", base=BASE), PLAN).log.xyz

    def without_base(text):
        return "\n".join(line for line in text.splitlines() if "ref pos" not in line) + "\n"

    path = pos_file(tmp_path, "baseline", base=BASE, change=without_base)
    with pytest.raises(
        InputError, match=r"base whose position its header does not state .*Add \[gnss\] base_deg"
    ):
        read_gnss(path, PLAN)
    stated = EarthFrame(crs=PLAN.crs, base_deg=BASE)
    np.testing.assert_allclose(read_gnss(path, stated).log.xyz, known, atol=1e-4)
    # A base in another place, stated for the survey, moves all fixes
    moved = EarthFrame(crs=PLAN.crs, base_deg=(BASE[0], BASE[1], BASE[2] + 2.0))
    path = pos_file(tmp_path, "baseline", base=BASE)
    np.testing.assert_allclose(read_gnss(path, moved).log.xyz[:, 2], known[:, 2] + 2.0, atol=1e-3)
    # A base in geocentric coordinates
    x, y, z = made.TO_GEOCENTRIC.transform(BASE[1], BASE[0], BASE[2])
    plain = f"{BASE[0]:.9f} {BASE[1]:.9f} {BASE[2]:.4f}"
    path = pos_file(
        tmp_path, "baseline", base=BASE, change=lambda t: t.replace(plain, f"{x:.4f} {y:.4f} {z:.4f}")
    )
    np.testing.assert_allclose(read_gnss(path, PLAN).log.xyz, known, atol=1e-3)


def test_covariances_that_are_not_along_the_axes_are_rotated(tmp_path):
    """A tenth of a metre along geocentric z alone: north and up by the latitude."""
    path = pos_file(tmp_path, "ecef")
    lines = path.read_text().splitlines()
    rows = [" ".join([*line.split()[:7], "0 0 0.1 0 0 0 0 0"]) for line in lines if not line.startswith("%")]
    path.write_text("\n".join([*(line for line in lines if line.startswith("%")), *rows]) + "\n")
    sigma = 0.1 * np.array([0.0, np.cos(np.radians(46.0)), np.sin(np.radians(46.0))])
    # A sigma of 0 is left out: east has none here
    with pytest.raises(InputError, match="no fix with sigmas above 0"):
        read_gnss(path, PLAN)
    path.write_text(path.read_text().replace("0 0 0.1 0 0 0", "0.02 0.02 0.1 0 0 0"))
    found = read_gnss(path, PLAN).log.sigma_m[0]
    np.testing.assert_allclose(found[1:], sigma[1:], rtol=0.05)
    assert found[0] == pytest.approx(0.02, rel=1e-3)


def rows_of(text):
    return [line for line in text.splitlines() if not line.startswith("%")]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("%  GPST", "%  JST "), "time system JST"),
        (lambda text: text.replace("latitude(deg)", "theta(deg)"), "expected latitude, x-ecef(m) or e-baseline"),
        (lambda text: "\n".join(rows_of(text)) + "\n", "no header line"),
        (lambda text: "\n".join(text.split("\n")[:4]) + "\n", "no rows"),
        (lambda text: text.replace("0.0500", "0.05x0").replace("0.0600", "nan"), "no usable rows (2 lines"),
        (lambda text: text.replace("2024/05/28", "2024/15/28"), "no usable rows (2 lines"),
        (lambda text: text.replace("2024/05/28 12:00", "9999 900000"), "no usable rows (2 lines"),
        (lambda text: text.replace("=WGS84/", "=Tokyo/"), "positions in the datum Tokyo, expected WGS84"),
        (lambda text: text.replace("46.0", "96.0"), "latitude 96"),
        (lambda text: text.replace("2024/05/28", "9999/05/28"), "no usable rows (2 lines"),
        (lambda text: text.replace("297.5000", "1e300").replace("298.2500", "-inf"), "no usable rows (2 lines"),
        (lambda text: text + text.replace("GPST", "UTC "), "line 10 names other columns or times"),
        (lambda text: text.replace("0.0 0.0 0.0   0.40   35.0", ""), "no usable rows (2 lines"),
        (lambda text: text + "\n".join(["% ref pos   : 46 9 1", "% ref pos   : 46 8 1"]), "another base position"),
        (lambda text: "% \0\0\0\n" * 5, "no header line"),
        (lambda text: "", "empty"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_line(tmp_path, change, words):
    with pytest.raises(InputError) as caught:
        read_gnss(pos_file(tmp_path, change=change), PLAN)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.advice


def test_a_line_that_is_cut_off_is_left_out(tmp_path):
    def cut(text):
        rows = rows_of(text)
        return text + "".join(
            rows[1].replace("18.500", f"{19 + i}.000") + "\n" for i in range(9)
        ) + rows[0][:40] + "\n"  # fmt: skip

    content = read_gnss(pos_file(tmp_path, change=cut), PLAN)
    assert len(content.log) == 11
    assert content.warnings == ("1 of 12 lines left out, the first is line 16",)
