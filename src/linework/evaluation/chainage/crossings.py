"""Where lines cross the perpendicular of a station, with what a report asks of them.

Separate from `samples`, which measures between them, and from `other_lines`, which doubts them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from linework.lines.crosscuts import CrossCuts
from linework.model.lines import LineSet

#: Lines that turn more than this from the axis do not run along the road (stop lines, crossing roads). [cosine of 25 deg]
_ALONG_COSINE = 0.9
#: A kerb's top edge belongs to the foot this near: a splayed face is 0.25 m wide. [m]
FACE_M = 0.5


class Crossing(NamedTuple):
    """A line where it crosses the perpendicular of a station."""

    kind: str
    name: str
    offset_m: float
    up_m: float
    sigma_xy_m: float
    sigma_z_m: float
    bridged: bool
    role: str = ""
    form: str = ""


def crossings_at(lines: LineSet, cuts: CrossCuts, n_stations: int) -> list[list[Crossing]]:
    """Return the lines along the road at each station, from right to left."""
    found: list[list[Crossing]] = [[] for _ in range(n_stations)]
    kinds, ids, roles, forms = (column.tolist() for column in (lines.kind, lines.id, lines.role, lines.form))
    for row in np.flatnonzero(np.abs(cuts.cosine) >= _ALONG_COSINE).tolist():
        i = int(cuts.line[row])
        found[int(cuts.station[row])].append(
            Crossing(
                kinds[i], ids[i] or f"line {i + 1}", float(cuts.offset_m[row]), float(cuts.up_m[row]),
                float(cuts.sigma_xy_m[row]), float(cuts.sigma_z_m[row]), bool(cuts.bridged[row]), roles[i], forms[i],
            )
        )  # fmt: skip
    return found
