"""NMEA and RTKLIB logs: times, heights, sigmas, damage."""

import datetime
from dataclasses import replace

import numpy as np
import pytest
from tests.scenes import gnss_files as made

from linework.crs import parse_crs
from linework.errors import ConfigError, CrsError, InputError
from linework.files.geodetic import EarthFrame
from linework.files.logs.gnss import read_gnss
from linework.files.trajectories.read import read_trajectory_content

PLAN = EarthFrame(crs=parse_crs("EPSG:25832"))
#: 2024-05-28 12:00:00 UTC as GPS seconds: 18 leap seconds since 1980
NOON = (datetime.datetime(2024, 5, 28, 12) - datetime.datetime(1980, 1, 6)).total_seconds() + 18


def nmea(folder, lines, name="gnss.nmea"):
    (folder / name).write_text("\r\n".join(lines) + "\r\n")
    return folder / name


def test_nmea_with_dates_heights_and_sigmas(tmp_path):
    lines = [
        made.rmc("120000.00", "280524"),
        made.gga("120000.00", 46.0, 9.0, 250.0),
        made.gst("120000.00", 0.02, 0.03, 0.05),
        made.gga("120000.50", 46.0, 9.0001, 251.0),
        made.sentence("GPGSV,1,1,00"),
        "12:00:01 " + made.gga("120001.00", 46.0, 9.0002, 252.0, quality=5, hdop="1.2"),
        made.gga("120001.50", 46.0, 9.0002, 252.0, quality=0),
    ]
    content = read_gnss(nmea(tmp_path, lines), PLAN)
    assert content.epoch == "gps"
    np.testing.assert_allclose(content.log.time_s, NOON + np.array([0, 0.5, 1.0]), atol=1e-6)
    # Altitude and separation are the height over the ellipsoid
    np.testing.assert_allclose(content.log.xyz[:, 2], [297.5, 298.5, 299.5], atol=1e-6)
    assert abs(content.log.xyz[0, 0] - 500000.0) < 1e-3
    np.testing.assert_allclose(content.log.sigma_m[0], [0.03, 0.02, 0.05])
    # Without GST: 1 cm of phase, 25 cm of float ambiguities times HDOP in plan, half for each axis
    np.testing.assert_allclose(np.hypot(*content.log.sigma_m[1:, :2].T), [0.008, 0.3])
    assert content.warnings == ("1 of 4 epochs have no fix",)


def test_nmea_over_midnight_and_the_date_of_zda(tmp_path):
    lines = [made.gga("235959.50", 46.0, 9.0, 1.0), made.gga("000000.00", 46.0, 9.0, 1.0),
             made.sentence("GNZDA,000000.00,29,05,2024,00,00"), made.gga("000000.50", 46.0, 9.0, 1.0)]  # fmt: skip
    content = read_gnss(nmea(tmp_path, lines, "log.txt"), PLAN)
    np.testing.assert_allclose(content.log.time_s, NOON + 43200 + np.array([-0.5, 0, 0.5]), atol=1e-6)


def test_nmea_without_any_date(tmp_path):
    content = read_gnss(nmea(tmp_path, [made.gga("000001.00", 46.0, 9.0, 1.0)]), PLAN)
    assert content.epoch == "utc_day"
    assert content.log.time_s.tolist() == [1.0]
    assert "no date" in content.warnings[0]


def test_damaged_sentences_are_counted_with_their_line(tmp_path):
    good = [made.gga(f"12{i // 60:02d}{i % 60:02d}.00", 46.0, 9.0, 1.0) for i in range(300)]
    good.insert(0, made.rmc("120000.00", "280524"))
    lines = [*good[:150], good[150].replace(",M,", ",N,", 1), "noise", *good[151:], good[-1][:30]]
    content = read_gnss(nmea(tmp_path, lines), PLAN)
    assert len(content.log.time_s) == 299
    assert "2 of 302 lines left out, the first is line 151" in content.warnings
    assert "1 lines hold no NMEA sentence" in content.warnings
    with pytest.raises(InputError, match=r"line 2 and 299 other of 301 lines are not sound NMEA sentences"):
        read_gnss(nmea(tmp_path, [line.replace("GNGGA", "GPGGA") for line in good]), PLAN)


def test_no_separation_and_no_fix(tmp_path):
    content = read_gnss(nmea(tmp_path, [made.gga("120000.00", 46.0, 9.0, 5.0, separation="")]), PLAN)
    assert content.log.xyz[0, 2] == 5.0
    assert any("no geoid separation" in text for text in content.warnings)
    with pytest.raises(InputError, match="no fix among 1 sentences"):
        read_gnss(nmea(tmp_path, [made.gga("120000.00", 46.0, 9.0, 5.0, quality=0)]), PLAN)


def test_heights_become_those_of_the_vertical_datum(tmp_path):
    path = nmea(tmp_path, [made.gga("120000.00", 46.0, 9.0, 250.0)])
    crs = parse_crs("EPSG:25832+7837")
    assert read_gnss(path, EarthFrame(crs=crs, geoid="receiver")).log.xyz[0, 2] == 250.0
    assert read_gnss(path, EarthFrame(crs=crs, geoid=40)).log.xyz[0, 2] == pytest.approx(257.5)
    with pytest.raises(
        CrsError, match=r"heights cannot be converted to those of .*no grid de_bkg_gcg2016\.tif.*geoid"
    ):
        read_gnss(path, EarthFrame(crs=crs))


def gtx(path, value):
    """Write a grid of undulations of 4 x 4 nodes at 1 degree from 44 N, 7 E (format of NOAA's VDatum)."""
    header = np.array([44.0, 7.0, 1.0, 1.0], ">f8").tobytes() + np.array([4, 4], ">i4").tobytes()
    path.write_bytes(header + np.full(16, value, ">f4").tobytes())


def test_a_grid_of_undulations(tmp_path):
    (tmp_path / "my grids").mkdir()
    gtx(tmp_path / "my grids/geoid.gtx", 45.0)
    frame = EarthFrame(crs=parse_crs("EPSG:25832+7837"), geoid="my grids/geoid.gtx", root=tmp_path)
    path = nmea(tmp_path, [made.gga("120000.00", 46.0, 9.0, 250.0)])
    assert read_gnss(path, frame).log.xyz[0, 2] == pytest.approx(252.5)
    with pytest.raises(ConfigError, match=r"geoid\.gtx: 1 of 1 places"):
        read_gnss(nmea(tmp_path, [made.gga("120000.00", 56.0, 9.0, 250.0)]), frame)
    (tmp_path / "other.gtx").write_text("no grid")
    with pytest.raises(ConfigError, match=r"other\.gtx: is not a geoid grid"):
        read_gnss(path, replace(frame, geoid="other.gtx"))


POS = """% program   : RTKLIB ver.2.4.3
% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)
%  {system}                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio
"""
ROW = "   46.000000000    9.000000000   297.5000   1   9   0.0200   0.0300   0.0500   0.0010   0.0010   0.0010   1.00    9.0\n"


@pytest.mark.parametrize(
    ("system", "time"),
    [("GPST", "2024/05/28 12:00:18.000"), ("UTC ", "2024/05/28 12:00:00.000"), ("GPST", "2316 216018.000")],
)
def test_pos_in_degrees(tmp_path, system, time):
    path = tmp_path / "rover.pos"
    path.write_text(POS.format(system=system) + time + ROW + time.replace(".000", ".500") + ROW)
    content = read_gnss(path, PLAN)
    assert content.epoch == "gps"
    np.testing.assert_allclose(content.log.time_s, NOON + np.array([0, 0.5]), atol=1e-6)
    np.testing.assert_allclose(content.log.xyz[0, [0, 2]], [500000.0, 297.5], atol=1e-3)
    np.testing.assert_allclose(content.log.sigma_m[0], [0.03, 0.02, 0.05])  # east, north, up
    assert content.warnings == ()
    path_of = read_trajectory_content(path)  # as a ready trajectory, in a local frame
    np.testing.assert_array_equal(path_of.trajectory.xyz[0], [0, 0, 0])


def test_pos_geocentric(tmp_path):
    a, e2 = 6378137.0, 1 - (1 - 1 / 298.257223563) ** 2
    lat, lon, height = np.radians(46.0), np.radians(9.0), 297.5
    n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    x, y = (n + height) * np.cos(lat) * np.array([np.cos(lon), np.sin(lon)])
    z = (n * (1 - e2) + height) * np.sin(lat)
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    c = 1e-4 * np.eye(3) + (0.05**2 - 1e-4) * np.outer(up, up)  # 1 cm in plan, 5 cm in height
    sd = [np.sign(v) * np.sqrt(abs(v)) for v in (c[0, 0], c[1, 1], c[2, 2], c[0, 1], c[1, 2], c[2, 0])]
    head = POS.format(system="GPST").replace(
        "latitude(deg) longitude(deg)  height(m)", "x-ecef(m) y-ecef(m) z-ecef(m)"
    )
    row = (
        f"2024/05/28 12:00:18.000 {x:.4f} {y:.4f} {z:.4f} 1 9 " + " ".join(f"{v:.6f}" for v in sd) + " 0 0\n"
    )
    (tmp_path / "rover.pos").write_text(head + row)
    log = read_gnss(tmp_path / "rover.pos", PLAN).log
    np.testing.assert_allclose(log.xyz[0, [0, 2]], [500000.0, 297.5], atol=1e-3)
    np.testing.assert_allclose(log.sigma_m[0], [0.01, 0.01, 0.05], atol=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("%  GPST", "%  JST "), "time system JST"),
        (lambda text: text.replace("latitude(deg)", "e-baseline(m)"), "expected latitude(deg) or x-ecef(m)"),
        (lambda text: text.split("\n")[-2] + "\n", "no header line"),
        (lambda text: "\n".join(text.split("\n")[:3]) + "\n", "no rows"),
        (lambda text: text.replace(".0200", ".02x0"), "no usable rows (1 lines"),
    ],
)  # fmt: skip
def test_pos_that_cannot_be_used(tmp_path, change, words):
    path = tmp_path / "rover.pos"
    path.write_text(change(POS.format(system="GPST") + "2024/05/28 12:00:18.000" + ROW))
    with pytest.raises(InputError) as caught:
        read_gnss(path, PLAN)
    assert words in str(caught.value)


def test_latitude_and_longitude_exchanged_and_another_continent(tmp_path):
    head = "time_s,latitude_deg,longitude_deg,ellipsoid_height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
    (tmp_path / "g.csv").write_text(head + "0,9.1,47.0,1,1,1,1\n")
    with pytest.raises(
        InputError, match=r"latitude 9\.1000, longitude 47\.0000 is far .* exchanged, they are within it"
    ):
        read_gnss(tmp_path / "g.csv", PLAN)
    (tmp_path / "g.csv").write_text(head + "0,40.0,-75.0,1,1,1,1\n")
    (warning,) = read_gnss(tmp_path / "g.csv", EarthFrame(crs=parse_crs("EPSG:32632"))).warnings
    assert "is far from the area of use of WGS 84 / UTM zone 32N (EPSG:32632)" in warning
    (tmp_path / "g.csv").write_text(
        head + "0,-45.0,179.9,1,1,1,1\n1,-45.0,-179.9,1,1,1,1\n2,-45,-179.8,1,1,1,1\n"
    )
    assert read_gnss(tmp_path / "g.csv", EarthFrame(crs=parse_crs("EPSG:32701"))).warnings == ()
