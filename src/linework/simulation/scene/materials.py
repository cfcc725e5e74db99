"""What things are made of, as a laser sees it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from linework.arrays import AnyArray, FloatArray


class Material(IntEnum):
    """Surface a ray can hit."""

    ASPHALT = 0
    KERB = 1
    FOOTWAY = 2
    GRASS = 3
    STEEL = 4
    CONCRETE = 5
    WOOD = 6
    MESH = 7
    LEAF = 8
    CAR = 9
    GLASS = 10
    TYRE = 11
    WALL = 12
    WIRE = 13
    POLE = 14
    SIGN = 15
    SOIL = 16


#: Per material: reflectance at the laser's wavelength (near infrared), share of beams that come back from it,
#: and roughness (standard deviation of the height of its small parts) [m]. Typical values of near-infrared
#: targets; extraction must not depend on them.
_TABLE: dict[Material, tuple[float, float, float]] = {
    Material.ASPHALT: (0.16, 0.99, 0.0015),
    Material.KERB: (0.30, 0.99, 0.001),
    Material.FOOTWAY: (0.27, 0.99, 0.002),
    Material.GRASS: (0.50, 0.97, 0.020),
    Material.STEEL: (0.42, 0.97, 0.0),
    Material.CONCRETE: (0.32, 0.99, 0.001),
    Material.WOOD: (0.45, 0.98, 0.001),
    Material.MESH: (0.25, 0.30, 0.0),
    Material.LEAF: (0.48, 0.85, 0.010),
    Material.CAR: (0.35, 0.85, 0.0),
    Material.GLASS: (0.08, 0.25, 0.0),
    Material.TYRE: (0.06, 0.95, 0.0),
    Material.WALL: (0.35, 0.99, 0.003),
    Material.WIRE: (0.20, 0.90, 0.0),
    Material.POLE: (0.35, 0.98, 0.0),
    Material.SIGN: (0.95, 1.00, 0.0),
    Material.SOIL: (0.30, 0.98, 0.010),
}

LASER_REFLECTANCE: FloatArray = np.array([_TABLE[m][0] for m in Material])
RETURN_SHARE: FloatArray = np.array([_TABLE[m][1] for m in Material])
ROUGHNESS_M: FloatArray = np.array([_TABLE[m][2] for m in Material])
#: Beams that do not come back from these go on to what is behind; from all others they are lost.
SEE_THROUGH: AnyArray = np.isin(np.arange(len(Material)), [Material.MESH, Material.LEAF, Material.GLASS])
GROUND: AnyArray = np.isin(
    np.arange(len(Material)),
    [Material.ASPHALT, Material.KERB, Material.FOOTWAY, Material.GRASS, Material.SOIL],
)
