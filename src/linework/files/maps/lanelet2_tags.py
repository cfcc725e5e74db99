"""Types of lines in Lanelet2, for our kinds, and back.

Separate from `lanelet2`, which reads and writes the files: here is what the words of one mean in the other.
"""

from __future__ import annotations

from collections.abc import Mapping

from linework.model.lineset.line import Line

#: Paint of this width and more is `line_thick`: between the narrow (10 to 15 cm) and the wide lines (25 to 30 cm) of
#: European rules (Germany's RMS-1, Britain's Traffic Signs Manual 5). [m]
_THICK_M = 0.20
#: Of double lines, from the outer edge of one to that of the other: two of 0.20 m with a gap of 0.10 m. [m]
_THICK_DOUBLE_M = 0.50
#: Patterns of double lines, from left to right. Two dashed lines are not among the subtypes.
DOUBLE_PATTERNS = ("solid_solid", "solid_dashed", "dashed_solid", "dashed_dashed")
#: Upstand of a kerb that a vehicle does not drive over: 60 mm is the least that can be felt with a cane and by a driver
#: (Britain's Inclusive Mobility); dropped kerbs have up to 25 mm. [m]
_HIGH_KERB_M = 0.06
#: Types by kind; markings and boundaries depend on more than the kind.
_TYPES = {"guardrail": "guard_rail", "barrier": "jersey_barrier", "fence": "fence", "wall": "wall"}
_OF_FORM = {"stop": "stop_line", "zebra": "zebra_marking"}
_KINDS = {
    "line_thin": "lane_marking", "line_thick": "lane_marking", "curbstone": "road_boundary",
    "road_border": "road_boundary", "guard_rail": "guardrail", "jersey_barrier": "barrier", "fence": "fence",
    "stop_line": "road_marking_other", "zebra_marking": "road_marking_other",
}  # fmt: skip
#: Before each of our own fields, so that they are not taken for tags of Lanelet2.
OWN = "linework:"


def tags_of_line(line: Line, fields: Mapping[str, str], *, number: int) -> dict[str, str]:
    """Return the tags of a line, ours among them; none where Lanelet2 has no type for it.

    What was not measured, such as the height of a kerb, has no tag.

    Parameters
    ----------
    number
        Place of the line in the set.
    """
    kind, form = str(line.kind), str(line.form)
    if kind == "lane_marking":
        pattern = str(line.pattern)
        is_thick = line.width_m >= (_THICK_DOUBLE_M if pattern in DOUBLE_PATTERNS else _THICK_M)
        tags = {"type": "line_thick" if is_thick else "line_thin"}
        tags |= {"subtype": "dashed" if pattern == "dashed_dashed" else pattern} if pattern else {}
        tags |= {"width": fields["width_m"]} if "width_m" in fields else {}
    elif kind == "road_boundary" and form == "kerb":
        tags = {"type": "curbstone"}
        if line.height_m > 0:
            tags |= {
                "subtype": "high" if line.height_m >= _HIGH_KERB_M else "low",
                "height": fields["height_m"],
            }
    elif kind == "road_boundary":
        tags = {"type": "road_border"}
    elif kind == "road_marking_other" and form in _OF_FORM:
        tags = {"type": _OF_FORM[form]}
    elif kind in _TYPES:
        tags = {"type": _TYPES[kind]}
    else:
        return {}
    return tags | {OWN + "line": str(number)} | {OWN + name: text for name, text in fields.items()}


def kind_of_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """Return the fields of a way: ours if it has them, else those that its type says, and its other tags.

    >>> found = kind_of_tags({"type": "line_thin", "subtype": "dashed"})
    >>> found["kind"], found["pattern"]
    ('lane_marking', 'dashed')
    >>> kind_of_tags({"type": "line_thick", "subtype": "solid_dashed"})["pattern"]
    'solid_dashed'
    """
    kind, subtype = tags.get("type", ""), tags.get("subtype", "")
    found = {name: text for name, text in tags.items() if not name.startswith(OWN)}
    found["kind"] = _KINDS.get(kind, kind or "way")
    if kind in ("line_thin", "line_thick"):
        found |= {"pattern": subtype} if subtype in ("solid", "dashed", *DOUBLE_PATTERNS) else {}
        if subtype in DOUBLE_PATTERNS:
            found["double"] = "true"
    elif kind in ("curbstone", "road_border"):
        found["form"] = "kerb" if kind == "curbstone" else "edge"
    elif kind in ("stop_line", "zebra_marking"):
        found["form"] = kind.split("_")[0]
    for ours, theirs in (("width_m", "width"), ("height_m", "height")):
        if theirs in tags:
            found[ours] = tags[theirs]
    return found | {name.removeprefix(OWN): text for name, text in tags.items() if name.startswith(OWN)}
