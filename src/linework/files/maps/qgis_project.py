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
from collections.abc import Sequence
from pathlib import Path

import pyproj

from linework.crs import LOCAL, epsg_text, horizontal_part
from linework.errors import UsageError
from linework.files.input import filled_file_bytes
from linework.files.maps.xml_text import xml_escaped, xml_quoted
from linework.files.output.publish import write_bytes
from linework.files.vectors.fields import LANE_LAYER, TABLES, qgis_style
from linework.files.vectors.gdal_input import pyogrio, reading_with_gdal

#: The time of an archive's entry, always the same one.
_DATE = (2000, 1, 1, 0, 0, 0)


#: What can lie below the lines, by the end of the file's name: kind of layer, and QGIS's reader of it. Point clouds need
#: QGIS 3.26 with COPC, and for others one that was built with PDAL.
_BACKGROUNDS = {
    ".copc.laz": ("point-cloud", "copc"), ".laz": ("point-cloud", "pdal"), ".las": ("point-cloud", "pdal"),
    ".tif": ("raster", "gdal"), ".tiff": ("raster", "gdal"),
}  # fmt: skip


def write_qgis_project(
    lines: Path, path: Path, background: Sequence[Path] = (), *, overwrite: bool = False
) -> int:
    """Write a project with the layers of a GeoPackage, and return their number; it names the files by relative paths.

    Parameters
    ----------
    lines
        A GeoPackage, as `write_lines` writes it.
    background
        GeoTIFF images (`linework raster`), and LAS, LAZ or COPC files of points, to be drawn below the lines.

    Raises
    ------
    UsageError
        Another format than a GeoPackage, or a background that QGIS cannot draw.
    InputError
        A background that is not there, or not an image.
    MissingPackageError
        For images the extra `reports` is needed.
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
    beside = _relative(lines, path)
    below = [_background(file, path, i) for i, file in enumerate(background)]
    extent = [float(v) for info in facts if info["features"] and info["total_bounds"] is not None
              for v in info["total_bounds"]]  # fmt: skip
    text = _project(lines.stem, beside, layers, crs, extent, below)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(f"{path.stem}.qgs", _DATE), text)
    write_bytes(buffer.getvalue(), path, overwrite=overwrite)
    return len(layers)


def _relative(file: Path, project: Path) -> str:
    """Return the path of a file from the folder of a project."""
    beside = os.path.relpath(file.absolute(), project.absolute().parent).replace(os.sep, "/")
    return beside if beside.startswith("..") else f"./{beside}"


def _background(file: Path, project: Path, number: int) -> tuple[str, str, str]:
    """Return what the tree of layers, their order, and the list of layers say of a background."""
    name = file.name.lower()
    found = next((kind for end, kind in _BACKGROUNDS.items() if name.endswith(end)), None)
    if found is None:
        raise UsageError(
            "not an image or points that QGIS draws",
            where=file,
            advice="give a .tif, .las, .laz or .copc.laz",
        )
    filled_file_bytes(file)
    kind, provider = found
    srs = ""
    if kind == "raster":
        from linework.files.images.geotiff import geotiff_crs

        srs = f"<srs>{_srs(geotiff_crs(file))}</srs>"
    key, source = f"background_{number}", _relative(file, project)
    return (
        f'<layer-tree-layer id="{key}" name={xml_quoted(file.name)} source={xml_quoted(source)} '
        f'providerKey="{provider}" checked="Qt::Checked" expanded="0"/>',
        f'<layer id="{key}"/>',
        f'<maplayer type="{kind}"><id>{key}</id><datasource>{xml_escaped(source)}</datasource>'
        f"<layername>{xml_escaped(file.name)}</layername>{srs}<provider>{provider}</provider></maplayer>",
    )


def _project(
    title: str,
    beside: str,
    layers: list[tuple[str, str]],
    crs: str,
    extent: list[float],
    background: list[tuple[str, str, str]],
) -> str:
    srs = _srs(crs)
    tree, order, found = [], [], []
    # In a tree of layers the first is drawn last
    for i, (name, kind) in enumerate(layers):
        key = f"{name}_{i}"
        source = f"{beside}|layername={name}"
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
    for in_tree, in_order, layer in background:
        tree.append(in_tree)
        order.append(in_order)
        found.append(layer)
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
