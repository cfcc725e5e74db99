"""Real drives, written as the formats that are read: where they were, how long they are, when."""

import numpy as np
import pytest
from tests.scenes.places import REAL

from linework.crs import parse_crs
from linework.files.geodetic import EarthFrame
from linework.files.logs.gnss import read_gnss
from linework.files.logs.sensors import read_navigation_logs
from linework.files.survey.open import open_survey

DATA = REAL / "trajectories"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no real drives in {DATA}")


def test_dresden_in_degrees_and_milliseconds(tmp_path):
    rows = np.genfromtxt(DATA / "dresden.csv", delimiter=",", names=True)
    new = np.append(True, (np.diff(rows["latitude"]) != 0) | (np.diff(rows["longitude"]) != 0))
    fixes = "".join(
        f"{t!r},{lat!r},{lon!r},{h!r},3,3,5\n"
        for t, lat, lon, h in rows[new][["millis", "latitude", "longitude", "altitude"]].tolist()
    )
    head = "time_s,latitude_deg,longitude_deg,ellipsoid_height_m,sigma_e_m,sigma_n_m,sigma_z_m\n"
    (tmp_path / "gnss.csv").write_text(head + fixes)
    gyro = "".join(f"{t!r},{w!r}\n" for t, w in rows[["millis", "yawrate"]].tolist())
    (tmp_path / "gyro.csv").write_text("time_s,yaw_rate_dps\n" + gyro)
    toml = 'crs = "EPSG:32633"\n[navigation]\ngnss = "gnss.csv"\ngyro = "gyro.csv"\n'
    (tmp_path / "survey.toml").write_text(toml)
    content = read_navigation_logs(open_survey([tmp_path]))
    assert [text for text in content.warnings if "milliseconds" in text] == [
        "gnss.csv: times are in milliseconds: converted to seconds",
        "gyro.csv: times are in milliseconds: converted to seconds",
    ]
    log = content.logs.gnss
    assert 200 < np.ptp(log.time_s) < 230
    # The length that its makers state
    assert abs(np.hypot(*np.diff(log.xyz[:, :2], axis=0).T).sum() - 1760.0) < 10.0
    assert abs(log.xyz[0, 0] - 415_000) < 5_000  # Dresden is west of the central meridian of zone 33


def test_berlin_as_geocentric_solutions(tmp_path):
    reference = np.genfromtxt(DATA / "berlin_reference_first140s.txt", usecols=(1, 2, 3, 4))
    odometry = np.genfromtxt(DATA / "berlin_odometry_first140s.txt", usecols=(1, 2))
    lines = [
        "%  GPST   x-ecef(m)  y-ecef(m)  z-ecef(m)   Q  ns  sdx(m)  sdy(m)  sdz(m)  sdxy(m)  sdyz(m)  sdzx(m) age(s) ratio"
    ]
    lines += [
        f"1800 {200_000 + t:.6f} {x:.4f} {y:.4f} {z:.4f} 1 9 0.02 0.02 0.02 0 0 0 0 0"
        for t, x, y, z in reference.tolist()
    ]
    (tmp_path / "berlin.pos").write_text("\n".join(lines) + "\n")
    log = read_gnss(tmp_path / "berlin.pos", EarthFrame(crs=parse_crs("EPSG:25833"))).log
    assert len(log.time_s) == len(reference)
    np.testing.assert_allclose(log.sigma_m, 0.02, atol=1e-9)
    # Chords are the same on the grid but for its scale (0.9996 to 1.0004) and the slope of the road
    chords = np.linalg.norm(np.diff(reference[:, 1:], axis=0), axis=1).sum()
    way = np.hypot(*np.diff(log.xyz[:, :2], axis=0).T).sum()
    assert abs(way / chords - 1.0) < 2e-3
    driven = np.trapezoid(odometry[:, 1], odometry[:, 0])
    assert abs(way / driven - 1.0) < 0.02
    assert 30 < np.median(log.xyz[:, 2]) < 120  # Berlin lies at 35 m, the ellipsoid 40 m below the geoid
