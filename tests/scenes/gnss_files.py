"""GNSS logs for tests, written from the formats' descriptions."""

import functools
import operator

import numpy as np
import pyproj

#: Columns of RTKLIB's layouts after the time.
POS_COLUMNS = {
    "degrees": "latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m)",
    "dms": "latitude(d'\")   longitude(d'\")  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m)",
    "ecef": "x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns   sdx(m)   sdy(m)   sdz(m)  sdxy(m)  sdyz(m)  sdzx(m)",
    "baseline": "e-baseline(m)  n-baseline(m)  u-baseline(m)   Q  ns   sde(m)   sdn(m)   sdu(m)  sden(m)  sdnu(m)  sdue(m)",
}
TO_GEOCENTRIC = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)


def sentence(body):
    return f"${body}*{functools.reduce(operator.xor, body.encode(), 0):02X}"


def angle(degrees, width):
    return f"{int(degrees):0{width}d}{(degrees - int(degrees)) * 60:011.8f}"


def gga(clock, latitude, longitude, altitude, *, quality=4, hdop="0.8", separation="47.5"):
    places = f"{angle(latitude, 2)},N,{angle(longitude, 3)},E" if quality else ",,,"
    return sentence(f"GNGGA,{clock},{places},{quality},12,{hdop},{altitude:.4f},M,{separation},M,1.0,0001")


def rmc(clock, ddmmyy, status="A"):
    return sentence(f"GPRMC,{clock},{status},4600.0,N,01100.0,E,20.0,90.0,{ddmmyy},,,A")


def gst(clock, north, east, up):
    return sentence(f"GNGST,{clock},0.5,0.1,0.1,45.0,{north},{east},{up}")


def sbet(rows, path):
    """Write rows of time, lat, lon [rad], height, roll, pitch, heading, wander [rad]."""
    records = np.zeros((len(rows), 17))
    records[:, :4], records[:, 7:11] = np.asarray(rows)[:, :4], np.asarray(rows)[:, 4:]
    path.write_bytes(records.astype("<f8").tobytes())


def pos(layout, times, places, sigma, *, system="GPST", base=None, quality=1):
    """Return a .pos of latitudes, longitudes [deg] and heights (n, 3), with sigmas east, north, up (n, 3) [m].

    `times` are the two cells of each time, `base` the position that baselines are from.
    """
    lines = ["% program   : RTKLIB ver.2.4.3 b34", "% inp file  : rover.obs"]
    if base is not None:
        lines.append(f"% ref pos   : {base[0]:.9f} {base[1]:.9f} {base[2]:.4f}")
    written = "e/n/u-baseline=WGS84" if layout == "baseline" else "lat/lon/height=WGS84/ellipsoidal"
    lines += [f"% ({written},Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)"]
    lines += [f"%  {system:<4}                  {POS_COLUMNS[layout]} age(s)  ratio"]
    for time, place, sd in zip(times, places, sigma, strict=True):
        cells, spread = _pos_cells(layout, place, sd, base)
        lines.append(f"{time[0]} {time[1]} {cells}   {quality}  12  {spread}   0.40   35.0")
    return "\n".join(lines) + "\n"


def _pos_cells(layout, place, sigma, base):
    """Return the cells of a position and of its covariance in a layout."""
    latitude, longitude, height = place
    e, n, u = sigma
    plain = f"{n:.4f} {e:.4f} {u:.4f} 0.0 0.0 0.0"
    if layout == "degrees":
        return f"{latitude:.11f} {longitude:.11f} {height:.4f}", plain
    if layout == "dms":
        angles = []
        for angle_deg in (latitude, longitude):
            size = abs(angle_deg)
            minutes = size % 1.0 * 60.0
            sign = "-" if angle_deg < 0.0 else ""
            angles.append(f"{sign}{int(size)} {int(minutes):02d} {minutes % 1.0 * 60.0:011.8f}")
        return f"{angles[0]} {angles[1]} {height:.4f}", plain
    x, y, z = TO_GEOCENTRIC.transform(longitude, latitude, height)
    axes = enu_axes(latitude, longitude)
    if layout == "ecef":
        c = axes.T @ np.diag(np.square(sigma)) @ axes
        roots = [np.sign(v) * np.sqrt(abs(v)) for v in (c[0, 0], c[1, 1], c[2, 2], c[0, 1], c[1, 2], c[2, 0])]
        return f"{x:.4f} {y:.4f} {z:.4f}", " ".join(f"{v:.6f}" for v in roots)
    start = np.array(TO_GEOCENTRIC.transform(base[1], base[0], base[2]))
    east, north, up = enu_axes(base[0], base[1]) @ (np.array([x, y, z]) - start)
    return f"{east:.4f} {north:.4f} {up:.4f}", f"{e:.4f} {n:.4f} {u:.4f} 0.0 0.0 0.0"


def enu_axes(latitude_deg, longitude_deg):
    """Return the geocentric directions east, north and up (3, 3)."""
    lat, lon = np.radians([latitude_deg, longitude_deg])
    return np.array([
        [-np.sin(lon), np.cos(lon), 0.0],
        [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
        [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
    ])  # fmt: skip
