"""The true class of every simulated point, from what its beam met.

Separate from `simulate`, which records points as a scanner does: a scanner does not know what it met.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, distance_along
from linework.methods.classes.point_class import PointClass
from linework.simulation.roads.scenario import Scenario
from linework.simulation.scene.materials import Material
from linework.simulation.scene.paint import paint_cover
from linework.simulation.scene.part import Scene
from linework.simulation.sensors.scanner import Hits

#: Class of each material; steel, concrete and wood are told apart by what they belong to.
_CLASS_OF = {
    Material.ASPHALT: PointClass.ROAD,
    Material.KERB: PointClass.KERB,
    Material.FOOTWAY: PointClass.FOOTWAY,
    Material.GRASS: PointClass.VERGE,
    Material.SOIL: PointClass.VERGE,
    Material.LEAF: PointClass.VEGETATION,
    Material.WIRE: PointClass.WIRE,
    Material.POLE: PointClass.POLE,
}
_OF_MATERIAL = np.array([_CLASS_OF.get(m, PointClass.OTHER) for m in Material], dtype=np.uint8)
#: Reach from the line of a guardrail or barrier to its posts, lid and ends, and its step along the line. [m]
_BESIDE_M, _STEP_M = 0.7, 0.25
#: A return this far from what the beam met is a stray, which lies on nothing: many times the noise of the range. [m]
_STRAY_M = 0.5


def classes_of_hits(scenario: Scenario, scene: Scene, hits: Hits, recorded: FloatArray) -> AnyArray:
    """Return the true `PointClass` of points, (n,) uint8.

    Parameters
    ----------
    hits
        Where the beams met the scene.
    recorded
        (n, 3) float64: the points that were recorded of them. [m, world]
    """
    material, target = scene.mesh.material[hits.triangle], scene.mesh.target[hits.triangle]
    found = _OF_MATERIAL[material]
    on_asphalt = np.flatnonzero(material == Material.ASPHALT)
    layout = scenario.layout
    cover = paint_cover(hits.chainage_offset[on_asphalt], layout.all_markings, scenario.seed, layout.symbols)
    found[on_asphalt[cover >= 0.5]] = PointClass.MARKING
    for kind, of, which in (
        ("guardrail", Material.STEEL, PointClass.RAIL),
        ("barrier", Material.CONCRETE, PointClass.BARRIER),
    ):
        lines = [line.xyz for line in scene.lines if line.kind == kind]
        here = np.flatnonzero(material == of)
        found[here[_is_beside(hits.xyz[here], lines)]] = which
    # Bark, not boards: what is of wood and no part of a fence
    boards = [line.xyz for line in scene.lines if line.kind == "fence"]
    wood = np.flatnonzero((material == Material.WOOD) & (target < 0))
    found[wood[~_is_beside(hits.xyz[wood], boards)]] = PointClass.VEGETATION
    off = np.linalg.norm(recorded - np.asarray(scenario.origin_m) - hits.xyz - hits.error_m, axis=1)
    found[(off > _STRAY_M) | np.isfinite(hits.false_range_m)] = PointClass.OTHER
    return found


def _is_beside(xyz: FloatArray, lines: list[FloatArray]) -> BoolArray:
    """Return which points (n, 3) are near lines, in plan."""
    if len(xyz) == 0 or not lines:
        return np.zeros(len(xyz), dtype=bool)
    places = []
    for line in lines:
        along = distance_along(line[:, :2])
        at = np.arange(0.0, along[-1] + _STEP_M, _STEP_M)
        places.append(np.stack([np.interp(at, along, line[:, axis]) for axis in range(2)], axis=-1))
    distance = cKDTree(np.concatenate(places)).query(xyz[:, :2], distance_upper_bound=_BESIDE_M)[0]
    return np.asarray(np.isfinite(distance))
