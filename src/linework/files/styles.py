"""How lines look in QGIS: one simple line symbol per kind, as QML."""

from __future__ import annotations

#: Colour (red, green, blue) and width [mm] by kind: colours that stay apart for the colour-blind (Okabe and Ito).
_LOOKS = {
    "lane_marking": ((240, 228, 66), 0.5),
    "lane_marking_dash": ((240, 228, 66), 0.9),
    "road_marking_other": ((230, 159, 0), 0.9),
    "road_boundary": ((213, 94, 0), 0.6),
    "kerb_top": ((204, 121, 167), 0.3),
    "guardrail": ((0, 114, 178), 0.7),
    "barrier": ((86, 180, 233), 0.7),
    "fence": ((0, 158, 115), 0.4),
    "cable": ((20, 20, 20), 0.4),
}
_OTHER = ((120, 120, 120), 0.4)
#: Layers of what stereo images showed, beside the lines that were kept: dotted, in the colour of their kind.
AS_MEASURED = "_stereo"
#: Lines that are no such thing, said people: thin, dashed, in the grey of other lines.
_REJECTED, _REJECTED_WIDTH_MM = "rejected", 0.2


def qgis_style(kind: str) -> str:
    """Return a QML document for the lines of one kind."""
    (red, green, blue), width_mm = _LOOKS.get(kind.removesuffix(AS_MEASURED), _OTHER)
    pen = "dot" if kind.endswith(AS_MEASURED) else "solid"
    if kind == _REJECTED:
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


def colour_of(kind: str) -> tuple[int, int, int]:
    """Return the red, green, blue a kind is drawn in."""
    return _LOOKS.get(kind.removesuffix(AS_MEASURED), _OTHER)[0]
