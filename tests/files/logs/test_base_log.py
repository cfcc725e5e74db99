"""Differences to a base log: two plain receivers that are off alike, and what of a base is refused."""

from __future__ import annotations

import datetime

import numpy as np
import pyproj
import pytest
from tests.scenes import gnss_files as made

from linework.errors import ConfigError, InputError
from linework.files.logs.sensors import read_navigation_logs
from linework.files.survey.open import open_survey

HEAD = "time_s,easting_m,northing_m,height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
BASE = np.array([500_200.0, 5_100_100.0, 250.0])
#: What both receivers are off by: metres, over minutes.
PHASE = np.array([0.0, 1.0, 2.0])


def error_at(time_s):
    return 2.0 * np.sin(np.asarray(time_s)[:, None] / 60.0 + PHASE)


def rows(times, places, sigma=1.0):
    columns = np.column_stack([times, places, np.full((len(times), 3), sigma)])
    return HEAD + "".join(",".join(f"{v:.4f}" for v in row) + "\n" for row in columns)


def survey_of(
    folder, *, rover_s, base_s, base=None, keys="base_m = [500200.0, 5100100.0, 250.0]", crs="EPSG:25832"
):
    """Write a rover that drives east at 10 m/s and a base, with the same errors; return the survey."""
    true = np.column_stack([500_000.0 + 10.0 * rover_s, np.full((len(rover_s), 2), [5_100_000.0, 251.0])])
    (folder / "rover.csv").write_text(rows(rover_s, true + error_at(rover_s)))
    name = "base.csv" if base is None else "base.nmea"
    (folder / name).write_text(rows(base_s, BASE + error_at(base_s)) if base is None else base)
    (folder / "survey.toml").write_text(
        f'crs = "{crs}"\n[navigation]\ngnss = "rover.csv"\n[gnss]\nbase = "{name}"\n{keys}\n'
    )
    return open_survey([folder]), true


def test_what_both_are_off_by_is_gone(tmp_path):
    rover_s, base_s = np.arange(0.0, 100.0, 0.2), np.arange(-0.5, 101.0, 1.0)
    survey, true = survey_of(tmp_path, rover_s=rover_s, base_s=base_s)
    content = read_navigation_logs(survey)
    assert np.abs(content.logs.gnss.xyz - true).max() < 1e-3
    # Sigmas are those of the receiver
    assert np.all(content.logs.gnss.sigma_m == 1.0)
    assert content.warnings == (
        "rover.csv: positions are differences to the base base.csv: approximate, since it is not known which "
        "satellites both used",
    )


def test_fixes_without_a_base_at_their_time_are_left_out(tmp_path):
    rover_s = np.arange(0.0, 300.0)
    # Every 30 s, one of them missing; off for two minutes; ends early
    base_s = np.array([10.0, 40.0, 100.0, 220.0, 250.0, 280.0])
    survey, true = survey_of(tmp_path, rover_s=rover_s, base_s=base_s)
    content = read_navigation_logs(survey)
    kept = ((rover_s >= 10.0) & (rover_s <= 100.0)) | ((rover_s >= 220.0) & (rover_s <= 280.0))
    assert content.logs.gnss.time_s.tolist() == rover_s[kept].tolist()
    assert np.abs(content.logs.gnss.xyz - true[kept]).max() < 0.3
    assert "148 of 300 fixes left out: no fix of the base base.csv at their time" in content.warnings[1]
    later, _ = survey_of(tmp_path, rover_s=rover_s, base_s=base_s + 1000.0)
    with pytest.raises(
        InputError, match=r"base\.csv: from 1010\.0 to 1280\.0 s, the rover from 0\.0 to 299\.0 s: no"
    ):
        read_navigation_logs(later)


def test_a_base_of_another_format_clock_and_known_by_degrees(tmp_path):
    """NMEA in UTC beside adjusted GPS seconds; the known position in degrees."""
    noon = datetime.datetime(2024, 5, 28, 12)
    start = (noon - datetime.datetime(1980, 1, 6)).total_seconds() + 18 - 1e9
    rover_s = start + np.arange(0.0, 60.0)
    back = pyproj.Transformer.from_crs("EPSG:25832", "EPSG:4326", always_xy=True)
    lines = [made.rmc("120000.00", "280524")]
    for i, place in enumerate(BASE + error_at(rover_s)):
        longitude, latitude = back.transform(*place[:2])
        lines.append(made.gga(f"1200{i:02d}.00", latitude, longitude, place[2] - 47.5, quality=1))
    longitude, latitude = back.transform(*BASE[:2])
    keys = f'base_deg = [{latitude:.9f}, {longitude:.9f}, 250.0]\n[time]\nepoch = "gps_adjusted"'
    survey, true = survey_of(
        tmp_path, rover_s=rover_s, base_s=None, base="\r\n".join(lines) + "\r\n", keys=keys
    )
    content = read_navigation_logs(survey)
    assert np.abs(content.logs.gnss.xyz - true).max() < 0.01
    assert any("base.nmea: times are GPS seconds: converted" in text for text in content.warnings)


def test_a_local_survey_takes_the_base_for_its_origin(tmp_path):
    head = "time_s,latitude_deg,longitude_deg,ellipsoid_height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
    for name, latitude in (("rover", 46.001), ("base", 46.0)):
        places = [f"{t},{latitude + 1e-5 * t:.9f},9.0,300,1,1,1" for t in range(5)]
        (tmp_path / f"{name}.csv").write_text(head + "\n".join(places) + "\n")
    (tmp_path / "survey.toml").write_text(
        'crs = "local"\n[navigation]\ngnss = "rover.csv"\n[gnss]\nbase = "base.csv"\nbase_deg = [46.0, 9.0, 300.0]\n'
    )
    xyz = read_navigation_logs(open_survey([tmp_path])).logs.gnss.xyz
    # Both drift north by a metre a second: the rover stands
    assert np.abs(xyz).max() < 0.01


@pytest.mark.parametrize(
    ("keys", "error", "words"),
    [
        ("", ConfigError, "gnss.base without the known position of the base. Add base_m ="),
        ("base_m = [500200.0, 5100100.0]", ConfigError, "gnss.base_m"),
        ("base_m = [500200.0, 5101100.0, 250.0]", InputError, "its fixes are 998 m from the known position"),
        ("base_deg = [146.0, 9.0, 250.0]", ConfigError, "expected latitude (-90 to 90), longitude (-360 to 360) and height"),
        ('base_at = "north"', ConfigError, "base_at"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, keys, error, words):
    times = np.arange(0.0, 10.0)
    with pytest.raises(error) as caught:
        read_navigation_logs(survey_of(tmp_path, rover_s=times, base_s=times, keys=keys)[0])
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_base_twice_outside_the_folder_and_far_away(tmp_path):
    times = np.arange(0.0, 10.0)
    survey_of(tmp_path, rover_s=times, base_s=times)
    stated = (tmp_path / "survey.toml").read_text()
    solution = made.pos(
        "degrees", [("2316", f"{t}") for t in times], [(46.05, 9.0, 251.0)] * 10, np.ones((10, 3))
    )
    (tmp_path / "rover.pos").write_text(solution)
    (tmp_path / "survey.toml").write_text(stated.replace("rover.csv", "rover.pos"))
    with pytest.raises(InputError, match=r"most fixes of the rover are differential already\. Remove"):
        read_navigation_logs(open_survey([tmp_path]))
    (tmp_path / "survey.toml").write_text(stated.replace("base.csv", "../base.csv"))
    with pytest.raises(ConfigError, match=r"gnss\.base: '\.\./base\.csv' is outside the folder"):
        open_survey([tmp_path])
    away = rows(times, BASE + np.array([0.0, 90_000.0, 0.0]) + error_at(times))
    (tmp_path / "base.csv").write_text(away)
    (tmp_path / "survey.toml").write_text(stated.replace("5100100.0", "5190100.0"))
    warnings = read_navigation_logs(open_survey([tmp_path])).warnings
    assert any("up to 90 km from the base base.csv: receivers so far apart" in text for text in warnings)
