"""A straight road whose numbers are known, for reports by chainage."""

import numpy as np
from tests.scenes.map_scenes import UTM

from linework.lines.crosscuts import axis_along
from linework.model.lines import LineSet


def straight(table, length_m=100.0, heading_deg=37.0, crossfall=0.0):
    """Return lines at offsets to the left of an axis with a heading, and the axis."""
    turn = np.radians(90 - heading_deg)
    ahead, left = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    s = np.arange(0.0, length_m + 0.1, 2.0)
    start = np.array([500_000.0, 5_400_000.0])
    shapes, columns = [], {"kind": [], "id": [], "pattern": []}
    for name, kind, offset, up, pattern, (a, b) in table:
        along = s[(s >= a) & (s <= b)] if b - a > 4 else np.array([a, b])
        xy = start + along[:, None] * ahead + offset * left
        shapes.append(np.column_stack([xy, 100 + up + crossfall * offset + 0.02 * along]))
        columns["kind"].append(kind)
        columns["id"].append(name)
        columns["pattern"].append(pattern)
    n = sum(map(len, shapes))
    lines = LineSet.from_lines(
        shapes, crs=UTM, sigma_xy_m=np.full(n, 0.006), sigma_z_m=np.full(n, 0.008), **columns
    )
    path = np.column_stack([start + s[:, None] * ahead, np.full(len(s), 100.0) + 0.02 * s])
    return lines, axis_along("B 1", path)


ROAD = [
    ("edge", "lane_marking", 3.5, 0.0, "solid", (0, 100)),
    ("middle", "lane_marking", 0.0, 0.0, "dashed", (0, 100)),
    ("right", "road_boundary", -3.4, 0.0, "", (0, 100)),
    ("left", "road_boundary", 4.0, 0.0, "", (0, 100)),
    ("top", "kerb_top", 4.1, 0.12, "", (0, 100)),
    ("dropped", "kerb_top", -3.5, 0.02, "", (0, 100)),
    ("rail a", "guardrail", 4.5, 0.68, "", (0, 40)),
    ("rail b", "guardrail", 4.5, 0.78, "", (60, 100)),
]


def rows_of(report, quantity, statistic="mean", **what):
    return [r for r in report.rows if (r.quantity, r.statistic) == (quantity, statistic)
            and all(getattr(r, name) == value for name, value in what.items())]  # fmt: skip
