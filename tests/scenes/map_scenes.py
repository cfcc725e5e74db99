"""Lines of a short road, one of every kind that maps have a type for."""

import numpy as np

from linework.model.lines import LineSet

UTM = "EPSG:25832+7837"


def road_lines() -> LineSet:
    """Return nine lines beside a bend of 300 m radius, with ids that are words."""
    s = np.linspace(0.0, 60.0, 31)
    table = {
        "edge": ("lane_marking", 3.5, 0.0, {"pattern": "solid", "width_m": 0.25, "double": True}),
        "dashed": ("lane_marking", 0.0, 0.0, {"pattern": "dashed", "width_m": 0.12}),
        "kerb": ("road_boundary", 4.0, 0.0, {"form": "kerb", "height_m": 0.12}),
        "verge": ("road_boundary", -4.0, 0.0, {"form": "edge"}),
        "top": ("kerb_top", 4.1, 0.12, {}),
        "rail": ("guardrail", -5.0, 0.75, {"height_m": 0.75}),
        "wall": ("barrier", -6.0, 0.9, {"form": "concrete"}),
        "wire": ("cable", 2.0, 6.5, {"clearance_m": 6.5}),
        "stop": ("road_marking_other", None, 0.0, {"form": "stop", "width_m": 0.5}),
    }
    shapes, columns = [], {}
    for name, (kind, offset, up, values) in table.items():
        along, across = (
            (s, np.full(len(s), offset)) if offset is not None else (np.full(4, 30.0), np.linspace(0, 3.5, 4))
        )
        radius = 300.0 - across
        angle = along / 300.0
        xyz = np.column_stack(
            [
                radius * np.sin(angle) + 512_345.6,
                300.0 - radius * np.cos(angle) + 5_403_210.9,
                101.5 + 0.03 * along + up,
            ]
        )
        shapes.append(xyz)
        for column, value in {"id": name, "kind": kind, "confidence": 0.9, **values}.items():
            columns.setdefault(column, {})[name] = value
    empty = {"width_m": np.nan, "height_m": np.nan, "clearance_m": np.nan, "double": False}
    given = {c: [v.get(name, empty.get(c, "")) for name in table] for c, v in columns.items()}
    n = sum(map(len, shapes))
    return LineSet.from_lines(
        shapes, crs=UTM, sigma_xy_m=np.full(n, 0.01), sigma_z_m=np.full(n, 0.02), **given
    )
