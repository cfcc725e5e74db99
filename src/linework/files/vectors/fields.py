"""Attribute fields of lines: those that every vector format writes, reading them back, and QGIS styles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, FloatArray, IntArray, offsets_of
from linework.errors import InputError, UsageError
from linework.files.vectors.pole_points import is_point
from linework.model.lines import CANDIDATE, KINDS, LINE_COLUMNS, POLE, VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import column_values, linear_parts
from linework.model.lineset.shown import LOOKS, OTHER_LOOK

#: Fields in the order of the manual; clearance_m follows for cables, then the optional ones.
FIELDS = (
    "id", "kind", "role", "pattern", "double", "form", "width_m", "height_m", "length_m", "confidence",
    "sigma_xy_m", "sigma_z_m", "bridged_m", "method", "source", "time_start_s", "time_end_s",
)  # fmt: skip
#: Fields of the review.
REVIEWED = ("review", "condition", "note")
#: Fields that are written together where any line has one of them: of rails and what stands beside the road like one, of
#: wires that hang together, of lines that two methods found, of the review, of candidates.
_GROUPS = (
    ("lower_m", "n_beams"),
    ("network", "span", "circuit"),
    ("disagreement_mean_m", "disagreement_rms_m"),
    REVIEWED,
    ("candidate_kind", "reason"),
)
#: Fields that a set of lines need not have.
OPTIONAL_FIELDS = ("clearance_m", *chain.from_iterable(_GROUPS))
_RAILS = ("guardrail", "barrier", "fence")
#: The layers that have a field, in formats with a layer for each kind; those not named are in all.
_LAYERS = {
    "lower_m": _RAILS,
    "n_beams": _RAILS,
    "clearance_m": ("cable",),
    "network": ("cable", POLE),
    "span": ("cable",),
    "circuit": ("cable",),
    "candidate_kind": (CANDIDATE,),
    "reason": (CANDIDATE,),
}
#: Layer of the lines that people rejected; and the tables of a line file that hold no lines.
REJECTED_LAYER = "rejected"
#: Layer of the lanes, whose rows follow from the lines.
LANE_LAYER = "lane"
TABLES = ("vertex", "layer_styles", "edit", "line_version", LANE_LAYER)
#: Decimals of values computed for the table only; columns of a LineSet are written exactly.
_COMPUTED_DECIMALS = 4


def field_values(lines: LineSet) -> dict[str, AnyArray]:
    """Return the fields (m,) of all lines: columns of the set, lengths, and rms of the vertex sigmas."""
    computed = {
        "length_m": lines.length_m,
        "bridged_m": lines.bridged_m,
        "sigma_xy_m": _rms_per_line(lines, lines.sigma_xy_m),
        "sigma_z_m": _rms_per_line(lines, lines.sigma_z_m),
    }
    rounded = {name: np.round(values, _COMPUTED_DECIMALS) for name, values in computed.items()}
    # A point has one sigma, which stands nowhere else
    points = is_point(lines)
    for name in ("sigma_xy_m", "sigma_z_m"):
        rounded[name][points] = getattr(lines, name)[lines.offsets[:-1][points]]
    own = {name: getattr(lines, name) for name in LINE_COLUMNS}
    in_use = (group for group in _GROUPS if any(_is_given(getattr(lines, name)).any() for name in group))
    names = (*FIELDS, "clearance_m", *chain.from_iterable(in_use))
    return {name: (rounded | own)[name] for name in names}


def _is_given(values: AnyArray) -> AnyArray:
    return values != "" if values.dtype.kind == "U" else np.isfinite(values)


def fields_of_kind(kind: str, known: Iterable[str]) -> tuple[str, ...]:
    """Return the known fields (see `field_values`) that the layer of a kind has."""
    return tuple(name for name in known if kind in (*_LAYERS.get(name, (kind,)), REJECTED_LAYER))


def vertex_columns(lines: LineSet) -> tuple[str, ...]:
    """Return the vertex columns that a file of these lines has; `observed` is written for truth only.

    Truth has the method "truth", or a vertex that was not observed; where all are True, the default, nothing is lost
    by leaving the column out.
    """
    is_truth = bool(np.any(lines.method == "truth")) or not bool(np.all(lines.observed))
    return tuple(name for name in VERTEX_COLUMNS if is_truth or name != "observed")


def _rms_per_line(lines: LineSet, sigma: FloatArray) -> FloatArray:
    """Return (m,) root mean square of the known sigmas of each line's vertices; NaN without any."""
    owner, known = lines.line_of_vertex, np.isfinite(sigma)
    n = np.bincount(owner[known], minlength=len(lines))
    total = np.bincount(owner[known], weights=sigma[known] ** 2, minlength=len(lines))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(total / n), dtype=np.float64)


def check_writable(lines: LineSet, where: object) -> None:
    """Refuse lines that no format can hold.

    Raises
    ------
    UsageError
        A coordinate that is not finite, or a line of fewer than two vertices or without length.
    """
    if not np.isfinite(lines.xyz).all():
        bad = int(np.flatnonzero(~np.isfinite(lines.xyz).all(axis=1))[0])
        line = int(lines.line_of_vertex[bad])
        if np.isfinite(lines.xyz[bad, :2]).all():
            raise UsageError(f"line {line} has a vertex without a height, as lines in two dimensions have", where=where,
                             advice="give the vertices heights")  # fmt: skip
        raise UsageError(f"line {line} has a coordinate that is not finite", where=where,
                         advice="leave such lines out")  # fmt: skip
    counts = np.diff(lines.offsets)
    short = np.flatnonzero(counts < 2)
    if len(short):
        raise UsageError(f"line {int(short[0])} has {int(counts[short[0]])} vertices, at least 2 make a line",
                         where=where, advice="leave such lines out")  # fmt: skip
    # Whether a vertex differs from the one before it in the same line
    moves = np.r_[False, np.any(np.diff(lines.xyz, axis=0) != 0.0, axis=1)]
    moves[lines.offsets[:-1]] = False
    still = np.flatnonzero(np.logical_or.reduceat(moves, lines.offsets[:-1]) == 0) if len(lines) else short
    if len(still):
        i = int(still[0])
        raise UsageError(f"line {i} has no length, all its {int(counts[i])} vertices are at one place", where=where,
                         advice="leave such lines out")  # fmt: skip


def lines_with_heights(lines: LineSet) -> tuple[LineSet, str]:
    """Return the lines whose vertices all have heights, and what was left out, "" for none; all, where none has.

    Drawings and maps of others hold flat lines beside others; no format here does.
    """
    flat = np.zeros(len(lines), dtype=bool)
    flat[lines.line_of_vertex[~np.isfinite(lines.xyz[:, 2])]] = True
    if not flat.any() or flat.all():
        return lines, ""
    return (
        lines.take(~flat),
        f"left out {np.count_nonzero(flat):,} of {len(lines):,} lines without heights (the first is line {int(np.flatnonzero(flat)[0])})",
    )


def layer_names(lines: LineSet) -> AnyArray:
    """Return the layer of each line: that of its kind (see `layer_name`), or `REJECTED_LAYER`."""
    pairs = zip(lines.kind.tolist(), (lines.review == "rejected").tolist(), strict=True)
    return np.array([REJECTED_LAYER if is_out else layer_name(kind) for kind, is_out in pairs], dtype=np.str_)


def ordered_layers(names: Sequence[str]) -> list[str]:
    """Return the layers without repeats, in the order of `KINDS`, others after them by name.

    >>> ordered_layers(["wall", "cable", "guardrail", "cable"])
    ['guardrail', 'cable', 'wall']
    """
    return sorted(set(names), key=lambda n: (KINDS.index(n) if n in KINDS else len(KINDS), n))


def layer_name(kind: str) -> str:
    """Return the layer of a kind: the kind itself where that is a safe name, else "line".

    >>> layer_name("guardrail"), layer_name('x"; drop'), layer_name("vertex")
    ('guardrail', 'line', 'line')
    """
    safe = kind.isascii() and kind.isidentifier() and kind == kind.lower() and len(kind) <= 60
    reserved = kind in (*TABLES, REJECTED_LAYER, "photolog", "event") or kind.startswith(
        ("gpkg_", "rtree_", "sqlite_")
    )
    return kind if safe and not reserved else "line"


def lines_from_geometries(
    shapes: AnyArray, columns: Mapping[str, Sequence[Any]], crs: str, where: object
) -> tuple[LineSet, IntArray]:
    """Build a LineSet from any shapely geometries and their properties.

    Multi-part geometries become one line per part, polygons one closed line per ring; points are left out.
    Missing heights are NaN: allowed in references, refused on writing.

    Returns
    -------
    lines, feature
        The set, and (m,) the index of the geometry each line came from.
    """
    parts, feature = linear_parts(shapes)
    coordinates, owner = shapely.get_coordinates(parts, include_z=True, return_index=True)
    if len(coordinates) and not np.isfinite(coordinates[:, :2]).all():
        raise InputError("coordinates that are not finite numbers", where=where, advice="correct the file")
    counts = np.bincount(owner, minlength=len(parts))
    offsets = offsets_of(counts)
    values: dict[str, Any] = {
        name: column_values(name, [columns[name][i] for i in feature])
        for name in LINE_COLUMNS
        if name in columns
    }
    return LineSet(xyz=coordinates, offsets=offsets, crs=crs, **values), feature


#: Suffix of the layers with the lines as measured in stereo images: dotted, in the colour of their kind.
AS_MEASURED = "_stereo"
#: Style of rejected lines and of candidates: thin, dashed; rejected ones in the grey of other lines.
_REJECTED, _REJECTED_WIDTH_MM = "rejected", 0.2
#: Diameter of the disc of a pole: the tenth of an inch at which maps draw small objects. [mm]
_MARKER_MM = 2.4


def qgis_style(kind: str) -> str:
    """Return a QML document for the lines of one kind."""
    (red, green, blue), width_mm = LOOKS.get(kind.removesuffix(AS_MEASURED), OTHER_LOOK)
    if kind == POLE:
        return _marker_style((red, green, blue))
    pen = "dot" if kind.endswith(AS_MEASURED) else "solid"
    if kind in (_REJECTED, CANDIDATE):
        pen, width_mm = "dash", _REJECTED_WIDTH_MM
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
        '<qgis version="3.22" styleCategories="Symbology">'
        '<renderer-v2 type="singleSymbol" enableorderby="0" forceraster="0" symbollevels="0">'
        '<symbols><symbol type="line" name="0" alpha="1" clip_to_extent="1" force_rhr="0">'
        '<layer class="SimpleLine" enabled="1" locked="0" pass="0"><Option type="Map">'
        '<Option name="capstyle" type="QString" value="round"/>'
        '<Option name="joinstyle" type="QString" value="round"/>'
        f'<Option name="line_color" type="QString" value="{red},{green},{blue},255"/>'
        f'<Option name="line_style" type="QString" value="{pen}"/>'
        f'<Option name="line_width" type="QString" value="{width_mm:g}"/>'
        '<Option name="line_width_unit" type="QString" value="MM"/>'
        "</Option></layer></symbol></symbols></renderer-v2>"
        "<blendMode>0</blendMode><layerGeometryType>1</layerGeometryType></qgis>"
    )


def _marker_style(colour: tuple[int, int, int]) -> str:
    """Return a QML document for points: discs of `_MARKER_MM`."""
    red, green, blue = colour
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
        '<qgis version="3.22" styleCategories="Symbology">'
        '<renderer-v2 type="singleSymbol" enableorderby="0" forceraster="0" symbollevels="0">'
        '<symbols><symbol type="marker" name="0" alpha="1" clip_to_extent="1" force_rhr="0">'
        '<layer class="SimpleMarker" enabled="1" locked="0" pass="0"><Option type="Map">'
        f'<Option name="color" type="QString" value="{red},{green},{blue},255"/>'
        '<Option name="name" type="QString" value="circle"/>'
        f'<Option name="size" type="QString" value="{_MARKER_MM:g}"/>'
        '<Option name="size_unit" type="QString" value="MM"/>'
        "</Option></layer></symbol></symbols></renderer-v2>"
        "<blendMode>0</blendMode><layerGeometryType>0</layerGeometryType></qgis>"
    )


def colour_of(kind: str) -> tuple[int, int, int]:
    """Return the red, green, blue of a kind."""
    return LOOKS.get(kind.removesuffix(AS_MEASURED), OTHER_LOOK)[0]
