"""GNSS, gyro and wheel logs of a survey.toml: columns, units, order, what is left out."""

import datetime

import numpy as np
import pytest
from tests.scenes import gnss_files as made

from linework.errors import ConfigError, InputError
from linework.files.logs.clock import to_survey_time
from linework.files.logs.sensors import read_navigation_logs
from linework.files.survey.open import open_survey

GNSS = "time_s,easting_m,northing_m,height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
DEGREES = "time_s,latitude_deg,longitude_deg,ellipsoid_height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
GYRO = "time_s,yaw_rate_dps,roll_deg,pitch_deg\n0,90,1,2\n1,-90,3,4\n"


def survey_of(
    folder, *, crs="EPSG:25832", gnss=GNSS + "0,1,2,3,.1,.2,.3\n1,2,3,4,.1,.2,.3\n", gyro=GYRO, wheels=None
):
    toml = f'crs = "{crs}"\n[navigation]\ngnss = "gnss.csv"\n'
    (folder / "gnss.csv").write_text(gnss)
    for name, text in (("gyro", gyro), ("wheels", wheels)):
        if text is not None:
            (folder / f"{name}.csv").write_text(text)
            toml += f'{name} = "{name}.csv"\n'
    toml += "[vehicle]\ntick_m = 0.03\ngnss_lever_m = [1, 2, 3]\n"
    (folder / "survey.toml").write_text(toml)
    return open_survey([folder])


def test_values_are_in_si_and_counts_stay_as_logged(tmp_path):
    wheels = "time_s,left_ticks,right_ticks\n0,65530,10\n1,4,20\n"  # a counter of 16 bits that wraps
    content = read_navigation_logs(survey_of(tmp_path, wheels=wheels))
    logs = content.logs
    assert content.warnings == ()
    np.testing.assert_array_equal(logs.gnss.xyz, [[1, 2, 3], [2, 3, 4]])
    np.testing.assert_array_equal(logs.gnss.sigma_m, [[0.1, 0.2, 0.3]] * 2)
    np.testing.assert_allclose(logs.gyro.yaw_rate_radps, [np.pi / 2, -np.pi / 2])
    np.testing.assert_allclose(logs.gyro.roll_pitch_rad, np.radians([[1, 2], [3, 4]]))
    np.testing.assert_array_equal(logs.wheels.ticks, [[65530, 10], [4, 20]])
    assert (logs.tick_m, logs.track_m, logs.gnss_lever_m) == (0.03, 1.5, (1.0, 2.0, 3.0))


def test_the_counted_wheels_are_those_of_the_rear_axle_or_of_the_front_one(tmp_path):
    wheels = "time_s,left_ticks,right_ticks\n0,1,10\n1,4,20\n"
    survey = survey_of(tmp_path, wheels=wheels)
    assert read_navigation_logs(survey).logs.wheelbase_m == 0.0

    def with_vehicle(text):
        stated = (tmp_path / "survey.toml").read_text().split("[vehicle]")[0]
        (tmp_path / "survey.toml").write_text(f"{stated}[vehicle]\n{text}\n")
        return read_navigation_logs(open_survey([tmp_path])).logs.wheelbase_m

    assert with_vehicle('axle = "front"\nwheelbase_m = 3.2') == 3.2
    assert with_vehicle('axle = "rear"\nwheelbase_m = 3.2') == 0.0
    with pytest.raises(
        ConfigError, match=r'survey\.toml: vehicle\.axle is "front", but .* no wheelbase_m\. Add'
    ):
        with_vehicle('axle = "front"')
    with pytest.raises(ConfigError, match=r"vehicle\.axle .*one of rear, front"):
        with_vehicle('axle = "middle"')
    with pytest.raises(ConfigError, match=r"vehicle\.wheelbase_m .*a number above 0"):
        with_vehicle('axle = "front"\nwheelbase_m = -3.2')


def test_speed_in_place_of_ticks_and_a_gyro_without_tilt(tmp_path):
    logs = read_navigation_logs(
        survey_of(tmp_path, gyro="yaw_rate_dps,time_s\n5,1\n", wheels="time_s,speed_mps\n0,5\n")
    ).logs
    assert logs.wheels.ticks is None
    np.testing.assert_array_equal(logs.wheels.speed_mps, [5])
    assert logs.gyro.roll_pitch_rad is None


def test_rows_out_of_order_twice_there_or_without_sigma(tmp_path):
    rows = ["3,3,0,0,1,1,1", "1,1,0,0,1,1,1", "2,2,0,0,1,0,1", "3,9,0,0,1,1,1", "4,4,0,0,1,1,1", "5,5,0"]
    content = read_navigation_logs(survey_of(tmp_path, gnss=GNSS + "\n".join(rows)))
    np.testing.assert_array_equal(content.logs.gnss.xyz[:, 0], [1, 3, 4])
    assert content.warnings == (
        "gnss.csv: 1 of 6 lines left out, the first is line 7",
        "gnss.csv: 1 of 5 fixes have a sigma of 0 or below: left out",
        "gnss.csv: time runs backwards 1 times, first at line 3: sorted",
        "gnss.csv: 1 rows with a repeated time left out",
    )


def test_degrees_become_the_surveys_coordinates(tmp_path):
    text = DEGREES + "0,46.0,9.0,300,.1,.1,.1\n1,46.0,11.0,301,.1,.1,.1\n"
    logs = read_navigation_logs(survey_of(tmp_path, gnss=text)).logs
    # On the central meridian of zone 32 the northing is the meridian's arc from the equator times 0.9996
    latitude = np.radians(np.linspace(0, 46, 200_001))
    e2 = 1 - (1 - 1 / 298.257222101) ** 2
    arc = np.trapezoid(6378137.0 * (1 - e2) / (1 - e2 * np.sin(latitude) ** 2) ** 1.5, latitude)
    np.testing.assert_allclose(logs.gnss.xyz[0], [500000.0, 0.9996 * arc, 300.0], atol=1e-3)
    # Two degrees east along the parallel, longer than its chord on the grid's scale by less than 0.1 %
    parallel = (
        np.radians(2.0)
        * np.cos(np.radians(46.0))
        * 6378137.0
        / np.sqrt(1 - e2 * np.sin(np.radians(46.0)) ** 2)
    )
    step = logs.gnss.xyz[1] - logs.gnss.xyz[0]
    assert abs(np.hypot(*step[:2]) / parallel - 1.0) < 1e-3
    assert step[0] > 0
    assert step[2] == 1.0


@pytest.mark.parametrize("epoch", ["gps_week", "gps_adjusted", "gps", "unix"])
@pytest.mark.parametrize("is_stated", [True, False])
@pytest.mark.parametrize("has_date", [True, False])
def test_all_logs_get_one_clock(tmp_path, epoch, is_stated, has_date):
    noon = datetime.datetime(2024, 5, 28, 12, tzinfo=datetime.UTC).timestamp()
    start = float(to_survey_time(np.array([noon]), "unix", epoch)[0])
    survey = survey_of(tmp_path, gyro=f"time_s,yaw_rate_dps\n{start!r},0\n{start + 1!r},1\n")
    lines = [made.rmc("120000.00", "280524")] * has_date + [
        *(made.gga(f"12000{i}.00", 46.0, 9.0, 1.0) for i in (0, 1))
    ]
    (tmp_path / "gnss.csv").rename(tmp_path / "gnss.nmea")
    (tmp_path / "gnss.nmea").write_text("\n".join(lines))
    text = (tmp_path / "survey.toml").read_text().replace("gnss.csv", "gnss.nmea")
    time = {"gps_week": "[time]\nepoch = 'gps_week'\nweek = 2316\n"}.get(
        epoch, f"[time]\nepoch = '{epoch}'\n"
    )
    (tmp_path / "survey.toml").write_text(text + time * is_stated)
    survey = open_survey([tmp_path])
    logs = read_navigation_logs(survey).logs
    np.testing.assert_allclose(logs.gnss.time_s, [start, start + 1], atol=1e-6)
    np.testing.assert_allclose(logs.gyro.time_s, [start, start + 1], atol=1e-6)


def test_logs_of_two_clocks(tmp_path):
    # Fixes in seconds since 1970, the gyro in GPS seconds of the week
    fixes = GNSS + "1716897600,1,2,3,.1,.2,.3\n1716897601,2,3,4,.1,.2,.3\n"
    content = read_navigation_logs(
        survey_of(tmp_path, gnss=fixes, gyro="time_s,yaw_rate_dps\n216017,0\n216019,1\n")
    )
    np.testing.assert_allclose(content.logs.gyro.time_s, [1716897599, 1716897601])
    assert content.warnings == (
        "gyro.csv: times are GPS seconds of the week: converted to seconds since 1970",
    )
    with pytest.raises(
        InputError, match=r"gyro\.csv: from 7\.0 to 8\.0 s, the GNSS fixes from .*no common time"
    ):
        read_navigation_logs(survey_of(tmp_path, gyro="time_s,yaw_rate_dps\n7,0\n8,1\n"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"gnss": "time_s,easting_m\n"}, "missing columns sigma_e_m, sigma_n_m, sigma_z_m, northing_m, height_m"),
        ({"gnss": "time_s,sigma_e_m,sigma_n_m,sigma_z_m,x\n"},
         "missing columns easting_m, northing_m, height_m or latitude_deg, longitude_deg, ellipsoid_height_m"),
        ({"wheels": "time_s,left_ticks\n0,1\n"}, "missing column right_ticks"),
        ({"wheels": "time_s,rpm\n0,1\n"}, "missing columns left_ticks, right_ticks or speed_mps"),
        ({"gnss": GNSS + "0,1,2,3,0,0,0\n"}, "no fix with sigmas above 0"),
        ({"gnss": DEGREES + "0,4600.0,11.0,1,1,1,1\n"}, "latitude 4600, longitude 11 is not a place on earth (1 of 1)"),
        ({"gyro": ""}, "empty file"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_line(tmp_path, options, words):
    with pytest.raises(InputError, match=r"(gnss|gyro|wheels)\.csv: ") as caught:
        read_navigation_logs(survey_of(tmp_path, **options))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_survey_without_a_gnss_log(tmp_path):
    (tmp_path / "survey.toml").write_text('crs = "local"\n')
    with pytest.raises(ConfigError, match="no GNSS log"):
        read_navigation_logs(open_survey([tmp_path]))
