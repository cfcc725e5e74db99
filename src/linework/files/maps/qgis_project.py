"""A QGIS project beside a GeoPackage of lines: its layers in their styles, ready to open.

Separate from the formats of lines: a project holds no lines, it points to the file that does.

References
----------
QGIS 3.22 project files: a zip (.qgz) with an XML document (.qgs).
"""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import pyproj

from linework.crs import LOCAL, epsg_text, horizontal_part
from linework.errors import UsageError
from linework.files.maps.xml_text import xml_escaped, xml_quoted
from linework.files.output.publish import write_bytes
from linework.files.vectors.fields import LANE_LAYER, TABLES, qgis_style
from linework.files.vectors.gdal_input import pyogrio, reading_with_gdal

#: The time of an archive's entry, always the same one.
_DATE = (2000, 1, 1, 0, 0, 0)


def write_qgis_project(lines: Path, path: Path, *, overwrite: bool = False) -> int:
    """Write a project with the layers of a GeoPackage, and return their number; it names the file by a relative path.

    Parameters
    ----------
    lines
        A GeoPackage, as `write_lines` writes it.

    Raises
    ------
    UsageError
        Another format than a GeoPackage.
    OutputExistsError, MachineError
        As for `publish`.
    """
    if lines.suffix.lower() != ".gpkg":
        raise UsageError("a QGIS project needs a GeoPackage", where=lines, advice="convert it to .gpkg first")
    with reading_with_gdal(lines) as source:
        listed = [(str(name), str(kind)) for name, kind in pyogrio.list_layers(source) if kind]
        layers = [(name, kind) for name, kind in listed if name not in TABLES or name == LANE_LAYER]
        facts = [pyogrio.read_info(source, layer=name) for name, _ in layers]
    crs = next((str(info["crs"]) for info in facts if info["crs"]), LOCAL)
    beside = os.path.relpath(lines.absolute(), path.absolute().parent).replace(os.sep, "/")
    extent = [float(v) for info in facts if info["features"] and info["total_bounds"] is not None
              for v in info["total_bounds"]]  # fmt: skip
    text = _project(lines.stem, beside, layers, crs, extent)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(f"{path.stem}.qgs", _DATE), text)
    write_bytes(buffer.getvalue(), path, overwrite=overwrite)
    return len(layers)


def _project(title: str, beside: str, layers: list[tuple[str, str]], crs: str, extent: list[float]) -> str:
    srs = _srs(crs)
    tree, order, found = [], [], []
    # In a tree of layers the first is drawn last
    for i, (name, kind) in enumerate(layers):
        key = f"{name}_{i}"
        source = f"{beside if beside.startswith('..') else './' + beside}|layername={name}"
        tree.append(
            f'<layer-tree-layer id="{key}" name={xml_quoted(name)} source={xml_quoted(source)} providerKey="ogr" '
            'checked="Qt::Checked" expanded="0"/>'
        )
        order.append(f'<layer id="{key}"/>')
        is_line = "Point" not in kind
        style = qgis_style(name) if is_line else ""
        renderer = style[style.index("<renderer-v2") : style.index("<blendMode")] if style else ""
        found.append(
            f'<maplayer type="vector" geometry="{"Line" if is_line else "Point"}" wkbType="{"LineStringZ" if is_line else "PointZ"}">'
            f"<id>{key}</id><datasource>{xml_escaped(source)}</datasource><layername>{xml_escaped(name)}</layername>"
            f'<srs>{srs}</srs><provider encoding="UTF-8">ogr</provider>{renderer}</maplayer>'
        )
    box = ""
    if extent:
        west, south = min(extent[0::4]), min(extent[1::4])
        east, north = max(extent[2::4]), max(extent[3::4])
        box = (
            f"<extent><xmin>{west}</xmin><ymin>{south}</ymin><xmax>{east}</xmax><ymax>{north}</ymax></extent>"
        )
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
        f'<qgis projectname={xml_quoted(title)} version="3.22.0-linework"><title>{xml_escaped(title)}</title>'
        f"<projectCrs>{srs}</projectCrs><layer-tree-group>{''.join(tree)}</layer-tree-group>"
        f'<mapcanvas name="theMapCanvas"><units>meters</units>{box}<destinationsrs>{srs}</destinationsrs></mapcanvas>'
        f"<projectlayers>{''.join(found)}</projectlayers><layerorder>{''.join(order)}</layerorder>"
        '<properties><SpatialRefSys><ProjectionsEnabled type="int">1</ProjectionsEnabled></SpatialRefSys><Paths><Absolute type="bool">false</Absolute></Paths></properties></qgis>\n'
    )


def _srs(crs: str) -> str:
    """Return a CRS as QGIS states it: by the code of the plan, which it draws in, and its WKT."""
    if crs == LOCAL:
        return "<spatialrefsys><authid></authid></spatialrefsys>"
    plan = horizontal_part(pyproj.CRS.from_user_input(crs))
    wkt = plan.to_wkt("WKT2_2019")
    code = epsg_text(wkt)
    return (
        f"<spatialrefsys><wkt>{xml_escaped(wkt)}</wkt><authid>{code}</authid>"
        f"<description>{xml_escaped(plan.name)}</description><geographicflag>false</geographicflag></spatialrefsys>"
    )
