"""Lines as DXF: 3-D polylines, a layer per kind and pattern of paint, attributes as extended data.

Separate from `read_write`, which imports it only for this suffix, because ezdxf takes half a second to import.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyproj
import shapely
from pyproj.exceptions import CRSError as ProjError

from linework.arrays import FloatArray
from linework.crs import LOCAL, stated_crs, unit_factors
from linework.errors import InputError, MachineError, extra_needed
from linework.files.input import filled_file_bytes
from linework.files.vectors.cad_codes import CadCode, codes_of_lines
from linework.files.vectors.fields import colour_of, field_values, fields_of_kind, layer_names, ordered_layers
from linework.files.vectors.gdal import foreign_lines
from linework.files.vectors.pole_points import is_point
from linework.model.lines import POLE, LineSet

with extra_needed("cad"):
    import ezdxf
    from ezdxf.colors import rgb2int
    from ezdxf.explode import virtual_block_reference_entities
    from ezdxf.filemanagement import new, readfile
    from ezdxf.math import Vec3

_APP = "LINEWORK"
#: Red, green and blue, and whether dashed.
_Look = tuple[tuple[int, int, int], bool]
#: DXF's code for text in extended data.
_STRING = 1000
#: Its codes for units ($INSUNITS), by metres per unit; 0 is none of them.
_UNITS = {1.0: 6, 0.3048: 2, 1200 / 3937: 21}
#: Longest text in extended data. [characters]
_MAX_TEXT = 250
#: Patterns of paint that have layers of their own, and the line type of dashed ones: a sign, not the measured rhythm,
#: which the dashes themselves have. [m: whole, dash, gap]
_PATTERNS = ("solid", "dashed", "solid_solid", "solid_dashed", "dashed_solid", "dashed_dashed")
#: Entities that are lines, and blocks that hold some; ours are points where poles are.
_READ = "LINE POLYLINE LWPOLYLINE ARC CIRCLE ELLIPSE SPLINE INSERT POINT"
#: Curves are read as chords this near to them: less than any line is known to. [unit of the drawing]
_CHORD = 1e-3
#: Curves of larger radius have no place on a road: their chords would fill the memory. [unit of the drawing]
_MAX_RADIUS = 1e6
_TOO_ROUND = f"a curve with a radius of more than {_MAX_RADIUS:g}"
#: Blocks in blocks deeper than this, and rows of blocks longer, are damaged.
_MAX_DEPTH, _MAX_COPIES = 8, 10_000
#: Entities of all blocks of a drawing, each as often as it is drawn: rows of rows of blocks would fill the memory.
_MAX_DRAWN = 1_000_000
_DASHED, _DASHED_PATTERN = "LINEWORK_DASHED", (2.0, 1.0, -1.0)


def write_dxf(
    lines: LineSet, part: Path, kinds: Sequence[str] = (), *, codes: Sequence[CadCode] = ()
) -> None:
    """Write lines as 3-D polylines on layers named for their kinds, or by feature codes (called through `publish`)."""
    # No time of day, no random identifiers: the same lines give the same bytes.
    options: Any = ezdxf.options  # type: ignore[attr-defined]
    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        document = new("R2010", units=_unit_code(lines.crs))
        document.appids.new(_APP)
        document.linetypes.add(_DASHED, pattern=_DASHED_PATTERN, description="dashed")
        coded = codes_of_lines(lines, codes)
        own = [name if code is None else code.layer for name, code in zip(_layers(lines), coded, strict=True)]
        looks = _looks(own, kinds, codes)
        for layer, look in looks.items():
            # Layers 0 and Defpoints are in every drawing
            if layer in document.layers:
                document.layers.get(layer).update_dxf_attribs(_drawn(look))
            else:
                document.layers.add(layer, **_drawn(look))
        by_name = {layer.lower(): look for layer, look in looks.items()}
        space, values, points = document.modelspace(), field_values(lines), is_point(lines)
        for i, code in enumerate(coded):
            attributes: dict[str, Any] = {"layer": own[i]}
            if code is not None and _look_of(code) != by_name[own[i].lower()]:
                attributes |= _drawn(_look_of(code))
            if points[i]:
                # Drawn as high as it is
                attributes["thickness"] = float(lines.height_m[i])
                entity: Any = space.add_point(lines[i].xyz[0].tolist(), dxfattribs=attributes)
            else:
                entity = space.add_polyline3d(lines[i].xyz.tolist(), dxfattribs=attributes)
            fields = {name: values[name][i] for name in fields_of_kind(str(lines.kind[i]), values)}
            entity.set_xdata(_APP, _extended_data(fields | ({} if code is None else {"code": code.code})))
        # ezdxf goes through a set of these, whose order differs between processes
        for used in sorted(document.entitydb.dxf_types_in_use()):
            document.classes.add_class(used)
        document.saveas(part)
    finally:
        options.write_fixed_meta_data_for_testing = before


def _look_of(code: CadCode) -> _Look:
    return code.color or colour_of(code.kind), (code.linetype or code.pattern) == "dashed"


def _drawn(look: _Look) -> dict[str, Any]:
    return {"true_color": rgb2int(look[0]), "linetype": _DASHED if look[1] else "Continuous"}


def _looks(used: Sequence[str], kinds: Sequence[str], codes: Sequence[CadCode]) -> dict[str, _Look]:
    """Return colour, and whether dashed, of each layer: those of all codes, or of all kinds, and the used ones."""
    looks: dict[str, _Look] = {}
    names: dict[str, str] = {}
    for code in codes:
        names.setdefault(code.layer.lower(), code.layer)
        looks.setdefault(names[code.layer.lower()], _look_of(code))
    for layer in ordered_layers([*used, *(() if codes else kinds)]):
        # DXF tells layers apart without regard to case
        if names.setdefault(layer.lower(), layer) == layer and layer not in looks:
            kind = layer.removesuffix("_solid").removesuffix("_dashed")
            looks[layer] = colour_of(kind), layer.endswith("_dashed")
    return looks


def _layers(lines: LineSet) -> list[str]:
    """Return the layer of each line: its kind, and for paint its pattern, which CAD programs tell by layers."""
    pairs = zip(layer_names(lines).tolist(), lines.pattern.tolist(), strict=True)
    return [f"{layer}_{pattern}" if pattern in _PATTERNS else layer for layer, pattern in pairs]


def _extended_data(fields: Mapping[str, Any]) -> list[tuple[int, Any]]:
    """Return the known fields as name=value strings."""
    tags = []
    for name, value in fields.items():
        if isinstance(value, str | np.str_):
            text = str(value)
        elif isinstance(value, bool | np.bool_):
            text = "true" if value else ""
        else:
            text = "" if math.isnan(value) else repr(float(value))
        if text:
            tags.append((_STRING, f"{name}={text}"[:_MAX_TEXT].replace("\n", " ")))
    return tags


def verify_dxf(part: Path, lines: LineSet, path: Path, *, codes: Sequence[CadCode] = ()) -> None:  # noqa: ARG001
    """Read the file back and compare every coordinate.

    Raises
    ------
    MachineError
        The lines read back are not those that were written.
    """
    back = read_dxf(part, "kind", None, LOCAL, [])
    if len(back) != len(lines) or not np.array_equal(back.xyz, lines.xyz):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )


def _unit_code(crs: str) -> int:
    plan_m = unit_factors(crs)[0]
    return next((code for unit_m, code in _UNITS.items() if abs(plan_m / unit_m - 1.0) < 1e-9), 0)


def prj_of(crs: str) -> bytes | None:
    """Return what belongs in the .prj beside a DXF file, where GIS programs look for the CRS: WKT, or None for "local"."""
    if crs == LOCAL:
        return None
    loaded = pyproj.CRS.from_wkt(crs)
    try:
        return loaded.to_wkt("WKT1_ESRI").encode()
    except ProjError:
        return crs.encode()


def read_dxf(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the lines, polylines and curves of a DXF file, those in blocks too, and our own poles.

    The kind of a line is its layer. Curves are chords that are nearer than a millimetre (of drawings in metres). Those that
    cannot be read are added to `left_out`.

    Raises
    ------
    InputError
        Not a DXF file, one whose blocks multiply, or one in feet without a CRS.
    """
    shapes, tables, places = [], [], []
    with _drawing_errors(path):
        drawing = readfile(path)
        listed, units = list(drawing.modelspace().query(_READ)), int(drawing.units)
    own_crs = _crs_of(path, units, crs)
    if _n_drawn(listed, {}) > _MAX_DRAWN:
        raise InputError(
            f"its blocks draw more than {_MAX_DRAWN:,} entities",
            where=path,
            advice="take out the rows of blocks",
        )
    for entity, layer in _entities(listed, left_out, set()):
        place = f"{entity.dxftype()} {entity.dxf.handle or 'of a block'} on layer {layer}"
        try:
            fields = _own_fields(entity)
            is_pole = entity.dxftype() == "POINT" and fields.get("kind") == POLE
            vertices = np.array([tuple(entity.dxf.location)]) if is_pole else _vertices(entity)
            if isinstance(vertices, str):
                left_out.append(f"{place}: {vertices}")
                continue
            if len(vertices) < 2 and not is_pole:
                continue
            with np.errstate(invalid="ignore"):
                shape = shapely.points(vertices[0]) if is_pole else shapely.linestrings(vertices)
        except MemoryError:
            raise
        # One damaged entity, whatever that raises, leaves the others as they are
        except Exception as error:
            left_out.append(f"{place}: is damaged ({_printed(error)})")
            continue
        shapes.append(shape)
        places.append(place)
        tables.append({"layer": layer} | fields)
    names = {name for table in tables for name in table}
    columns = {name: [table.get(name) for table in tables] for name in names}
    kind = columns.get(kind_field, columns.get("layer", []))
    array = np.array([*shapes, None], dtype=object)[:-1]
    return foreign_lines(array, kind, columns, kinds, own_crs, path, left_out, places)


def _crs_of(path: Path, units: int, given: str | None) -> str:
    """Return the CRS of a drawing: that in the .prj beside it, the given one, or "local" where its units are no feet."""
    prj = path.with_suffix(".prj")
    if prj.is_file():
        return (
            stated_crs(prj.read_text(encoding="utf-8", errors="replace"), given, where=prj) or given or LOCAL
        )
    if given is None and units in (code for metres, code in _UNITS.items() if metres != 1.0):
        advice = "give the CRS of its coordinates, or scale it to metres"
        raise InputError("the drawing is in feet, and no CRS says of which system", where=path, advice=advice)
    return given or LOCAL


@contextlib.contextmanager
def _drawing_errors(path: Path) -> Iterator[None]:
    """Turn what ezdxf raises while it reads a file, whatever that is, into one line."""
    filled_file_bytes(path)
    try:
        yield
    except MemoryError:
        raise
    # Damage comes out as errors of types and values, of keys, of attributes and of infinite numbers
    except Exception as error:
        raise InputError(
            f"is not a DXF file ({_printed(error)})", where=path, advice="check what this file is"
        ) from error


def _printed(error: Exception) -> str:
    return "".join(c if c.isprintable() else "?" for c in str(error)[:100])


def _entities(
    listed: Iterable[Any], left_out: list[str], said: set[str], layer: str = "0", depth: int = 0
) -> Iterator[tuple[Any, str]]:
    """Yield entities with their layers, those of blocks at their places; on layer 0 they are on that of the block.

    What cannot be read of a block is added to `left_out`, and the name of the block to `said`, so that it is there once.
    """
    for entity in listed:
        own = entity.dxf.layer if entity.dxf.layer != "0" or depth == 0 else layer
        if entity.dxftype() != "INSERT":
            yield entity, own
            continue
        wrong: list[str] = []
        yield from _entities(_drawn_blocks(entity, depth, wrong), left_out, said, own, depth + 1)
        name = str(entity.dxf.get("name", ""))
        if wrong and name not in said:
            said.add(name)
            left_out.append(f"block {name} on layer {own}: {wrong[0]}")


def _n_drawn(listed: Iterable[Any], known: dict[tuple[str, int], int], depth: int = 0) -> int:
    """Return how many entities of blocks, and copies of blocks, the listed ones draw; `known` holds those of blocks."""
    n = 0
    for entity in listed:
        if entity.dxftype() != "INSERT":
            continue
        # What is damaged is said where it is drawn
        with contextlib.suppress(Exception):
            copies, parts = max(entity.mcount, 1), _parts(entity)
            if parts is None or depth >= _MAX_DEPTH or copies > _MAX_COPIES:
                continue
            key = (str(entity.dxf.name).lower(), depth)
            if key not in known:
                known[key] = 1 + len(parts) + _n_drawn(parts, known, depth + 1)
            n += copies * known[key]
    return n


def _parts(insert: Any) -> list[Any] | None:
    """Return the entities of a block that are read, None where there is no such block."""
    block = insert.block()
    return None if block is None else [part for part in block if part.dxftype() in _READ.split()]


def _drawn_blocks(insert: Any, depth: int, wrong: list[str]) -> Iterator[Any]:
    """Yield the entities of a block, once for each copy of it in a row; what is wrong with it is added to `wrong`."""
    try:
        parts = _parts(insert)
        if parts is None:
            wrong.append("there is no such block")
            return
        if depth >= _MAX_DEPTH or insert.mcount > _MAX_COPIES:
            wrong.append(f"more than {_MAX_DEPTH} blocks in each other, or {_MAX_COPIES:,} beside each other")
            return
        copies = list(insert.multi_insert()) if insert.mcount > 1 else [insert]
        matrices = [copy.matrix44() for copy in copies]
    except MemoryError:
        raise
    except Exception as error:
        wrong.append(f"is damaged ({_printed(error)})")
        return
    for matrix in matrices:
        for part in parts:
            try:
                placed = list(virtual_block_reference_entities(_Alone(part, matrix)))  # type: ignore[arg-type]
            except MemoryError:
                raise
            except Exception as error:
                wrong.append(f"{part.dxftype()} in it is damaged ({_printed(error)})")
                continue
            yield from (one for one in placed if one.dxftype() in _READ.split())


class _Alone(NamedTuple):
    """A block of one entity, as ezdxf asks for it, so that a damaged one leaves the others of its block."""

    part: Any
    matrix: Any

    def dxftype(self) -> str:
        return "INSERT"

    def block(self) -> list[Any]:
        return [self.part]

    def matrix44(self) -> Any:
        return self.matrix


def _vertices(entity: Any) -> FloatArray | str:
    """Return the vertices (n, 3) of an entity in the world, or what cannot be read."""
    kind = entity.dxftype()
    if kind == "POINT":
        return np.zeros((0, 3))
    if kind == "LINE":
        points = [tuple(entity.dxf.start), tuple(entity.dxf.end)]
    elif kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        return "a mesh is not read"
    elif kind == "POLYLINE" and entity.is_3d_polyline:
        points = [tuple(vertex.dxf.location) for vertex in entity.vertices]
        points += points[:1] if entity.is_closed else []
    elif kind in ("LWPOLYLINE", "POLYLINE") and not entity.has_arc:
        points = [tuple(vertex) for vertex in _flat_vertices(entity)]
        points += points[:1] if entity.is_closed else []
    else:
        if kind in ("LWPOLYLINE", "POLYLINE"):
            return _round(entity)
        # No number is not less either
        if not _largest_radius(entity) <= _MAX_RADIUS:
            return _TOO_ROUND
        points = [tuple(p) for p in entity.flattening(_CHORD)]
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def _flat_vertices(entity: Any) -> Iterable[Any]:
    """Return the vertices in the world of a polyline that is drawn in a plane."""
    # Of a drawing that is seen from above they are what they are
    corners = _corners(entity)
    return corners if tuple(entity.dxf.extrusion) == (0.0, 0.0, 1.0) else entity.ocs().points_to_wcs(corners)


def _corners(entity: Any) -> list[Any]:
    """Return the vertices of a polyline in its plane, with its height; where it has none, with their own."""
    if entity.dxftype() == "LWPOLYLINE":
        return [Vec3(x, y, entity.dxf.elevation) for x, y in entity.get_points("xy")]
    up = entity.dxf.elevation.z if entity.dxf.hasattr("elevation") else None
    places = [vertex.dxf.location for vertex in entity.vertices]
    # Every polyline may state a height of 0, as one that stands for none
    return [Vec3(place.x, place.y, up) for place in places] if up else places


def _round(entity: Any) -> FloatArray | str:
    """Return the vertices (n, 3) in the world of a polyline with arcs, or that one is too large.

    The bulge between two corners is the tangent of a quarter of the angle of their arc, positive against the clock.
    """
    corners = np.array([tuple(corner) for corner in _corners(entity)], dtype=np.float64).reshape(-1, 3)
    bulges = (
        [bulge for (bulge,) in entity.get_points("b")]
        if entity.dxftype() == "LWPOLYLINE"
        else [vertex.dxf.bulge for vertex in entity.vertices]
    )
    if entity.is_closed:
        corners, bulges = np.vstack([corners, corners[:1]]), [*bulges, 0.0]
    found = [corners[:1]]
    for start, end, bulge in zip(corners[:-1], corners[1:], bulges[:-1], strict=True):
        chord, size = math.dist(start[:2], end[:2]), abs(bulge)
        # So flat that its chord is as near as chords are asked to be (the arc's rise is half of this)
        if size * chord <= _CHORD:
            found.append(end[None])
            continue
        radius = chord * (1.0 + size * size) / (4.0 * size)
        # A flat arc has a large radius, and is as large as its chord; others are as large as their circle
        if not (chord if size <= 1.0 else radius) <= _MAX_RADIUS:
            return _TOO_ROUND
        angle = 4.0 * math.atan(bulge)
        step = 2.0 * math.acos(max(1.0 - _CHORD / radius, 0.0))
        turned = np.linspace(0.0, angle, math.ceil(abs(angle) / step) + 1)[1:-1]
        # Chords of a circle from one place of it: as long as sines of half the angle, in the direction of its half
        to = np.sin(turned / 2) / math.sin(angle / 2) * np.exp(0.5j * (turned - angle))
        to *= complex(*(end - start)[:2])
        found.append(np.column_stack([start[0] + to.real, start[1] + to.imag, np.full(len(to), start[2])]))
        found.append(end[None])
    places = np.vstack(found)
    if tuple(entity.dxf.extrusion) == (0.0, 0.0, 1.0):
        return places
    return np.array([tuple(p) for p in entity.ocs().points_to_wcs(Vec3.list(places))]).reshape(-1, 3)


def _largest_radius(entity: Any) -> float:
    kind = entity.dxftype()
    if kind in ("ARC", "CIRCLE"):
        return abs(float(entity.dxf.radius))
    if kind == "ELLIPSE":
        return float(entity.dxf.major_axis.magnitude)
    # A spline is within its control points
    places = np.array([tuple(place) for place in entity.control_points], dtype=np.float64).reshape(-1, 3)
    return float(np.ptp(places, axis=0).max()) if len(places) else 0.0


def _own_fields(entity: Any) -> dict[str, str]:
    if not entity.has_xdata(_APP):
        return {}
    texts = [tag.value for tag in entity.get_xdata(_APP) if tag.code == _STRING]
    return dict(text.split("=", 1) for text in texts if "=" in text)
