"""Road marks of OpenDRIVE: what is painted on a border, double lines among them.

Separate from `opendrive`, which writes the roads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from linework.files.maps.xml_text import xml_quoted
from linework.lines.dashes import MarkingRhythm
from linework.lines.doubles import Stripe
from linework.model.lines import LineSet

#: Length of a solid line in a road mark, which repeats it without a space. [m]
_WHOLE_M = 1.0
_MARK_TYPES = {"solid": "solid", "dashed": "broken"}


class Drawn(NamedTuple):
    """Lines with each double line as one, the texts of their fields, and the stripes of the double ones."""

    lines: LineSet
    fields: Sequence[Mapping[str, str]]
    stripes: Mapping[int, tuple[Stripe, Stripe]]


def road_mark(drawn: Drawn, i: int, *, is_left: bool = False) -> str:
    """Return the road mark of a bound; its colour was not measured, and its fields are data of ours.

    Double lines are named from the inside of the road to its outside, in the middle of the road from left to right.
    """
    line, stripes = drawn.lines[i], drawn.stripes.get(i, ())
    if line.kind == "road_boundary":
        kind = "curb" if line.form == "kerb" else "edge"
    else:
        words = [_MARK_TYPES.get(word, "") for word in str(line.pattern).split("_")]
        kind = " ".join(words[::-1] if is_left else words) if all(words) else "custom"
    width = f' width="{float(line.width_m)!r}"' if line.width_m > 0 else ""
    change = "both" if "solid" not in kind and "broken" in kind else "none"
    parts = [_stripe(stripe) for stripe in stripes]
    if parts and width and all(parts):
        parts = [f'<type name="{kind}"{width}>{"".join(parts)}</type>']
    else:
        parts = []
    return (
        f'<roadMark sOffset="0.0" type="{kind}" weight="standard" color="standard"{width} laneChange="{change}">'
        f"{''.join(parts)}{user_data(drawn.fields[i])}</roadMark>"
    )


def _stripe(stripe: Stripe) -> str:
    """Return one line of a double line, "" where its width or its dashes are unknown; a solid one is one long dash."""
    dash = stripe.rhythm if stripe.pattern == "dashed" else MarkingRhythm(_WHOLE_M, 0.0)
    if dash is None or not stripe.width_m > 0:
        return ""
    return (
        f'<line length="{float(dash.dash_m)!r}" space="{float(dash.gap_m)!r}" width="{float(stripe.width_m)!r}" '
        f'tOffset="{float(stripe.offset_m)!r}" sOffset="0.0"/>'
    )


def user_data(fields: Mapping[str, str]) -> str:
    """Return our own fields as data of ours."""
    return "".join(
        f"<userData code={xml_quoted('linework:' + k)} value={xml_quoted(v)}/>" for k, v in fields.items()
    )
