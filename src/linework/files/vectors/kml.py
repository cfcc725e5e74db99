"""Lines as KML, in degrees, for viewing on a globe."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np
import pyproj
from pyproj.exceptions import ProjError

from linework.arrays import FloatArray
from linework.crs import LOCAL, describe_crs, horizontal_part
from linework.errors import CrsError, MachineError
from linework.files.vectors.fields import colour_of, layer_names, ordered_layers
from linework.files.vectors.pole_points import is_point
from linework.lines.units import in_metres
from linework.model.lines import LineSet

_NAMESPACE = "http://www.opengis.net/kml/2.2"
#: 1e-8 degrees are about 1 mm.
_DEGREE_DECIMALS = 8


def write_kml(lines: LineSet, part: Path, kinds: Sequence[str] = ()) -> None:
    """Write a folder per kind (called through `publish`); heights stay as they are, drawn above sea level.

    Raises
    ------
    CrsError
        The lines are local, or PROJ knows no exact transformation to degrees.
    """
    degrees, layers, points = _in_degrees(lines, part), layer_names(lines), is_point(lines)
    names = ordered_layers([*layers.tolist(), *kinds])
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="{_NAMESPACE}"><Document>\n')
        for layer in names:
            red, green, blue = colour_of(layer)
            file.write(
                f'<Style id="{layer}"><LineStyle><color>ff{blue:02x}{green:02x}{red:02x}</color>'
                "<width>2</width></LineStyle></Style>\n"
            )
        for layer in names:
            file.write(f"<Folder><name>{layer}</name>\n")
            for i in np.flatnonzero(layers == layer):
                # A pole is drawn from its top down to the ground
                first = lines.offsets[i + 1] - 1 if points[i] else lines.offsets[i]
                vertices = degrees[first : lines.offsets[i + 1]]
                tag, extruded = ("Point", "<extrude>1</extrude>") if points[i] else ("LineString", "")
                text = " ".join(
                    f"{x:.{_DEGREE_DECIMALS}f},{y:.{_DEGREE_DECIMALS}f},{z:.3f}" for x, y, z in vertices
                )
                file.write(
                    f"<Placemark><name>{escape(str(lines.id[i]))}</name><styleUrl>#{layer}</styleUrl>"
                    f"<{tag}>{extruded}<altitudeMode>absolute</altitudeMode>"
                    f"<coordinates>{text}</coordinates></{tag}></Placemark>\n"
                )
            file.write("</Folder>\n")
        file.write("</Document></kml>\n")


def _in_degrees(lines: LineSet, where: Path) -> FloatArray:
    """Return (n, 3) longitude, latitude [deg], height [m]."""
    lines = in_metres(lines)
    if lines.crs == LOCAL:
        raise CrsError("KML needs georeferenced lines, these are local", where=where,
                       advice="write .gpkg, .geojson or .dxf")  # fmt: skip
    plan = horizontal_part(pyproj.CRS.from_wkt(lines.crs))
    try:
        transformer = pyproj.Transformer.from_crs(plan, "EPSG:4326", always_xy=True, allow_ballpark=False)
        east, north = transformer.transform(lines.xyz[:, 0], lines.xyz[:, 1], errcheck=True)
    except ProjError as error:
        raise CrsError(f"PROJ knows no exact transformation from {describe_crs(lines.crs)} to degrees", where=where,
                       advice="write .gpkg, .geojson or .dxf") from error  # fmt: skip
    return np.stack([east, north, lines.xyz[:, 2]], axis=1)


def verify_kml(part: Path, lines: LineSet, path: Path) -> None:
    """Parse the file and count its lines and vertices.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    try:
        texts = [e.text or "" for e in ElementTree.parse(part).iter(f"{{{_NAMESPACE}}}coordinates")]
    except ElementTree.ParseError:
        texts = []
    counts = [len(text.split()) for text in texts]
    if sorted(counts) != sorted(np.where(is_point(lines), 1, np.diff(lines.offsets)).tolist()):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )
