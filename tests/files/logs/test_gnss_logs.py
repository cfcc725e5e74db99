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
