"""GNSS logs for tests, written from the formats' descriptions."""

import functools
import operator

import numpy as np


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
