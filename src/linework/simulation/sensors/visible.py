"""What things are made of, as a camera sees it: share of the light that comes back, and the grain of surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.images.grain import grain
from linework.simulation.roads.scenario import RoadLayout
from linework.simulation.scene.materials import Material
from linework.simulation.scene.part import Scene

#: Per material: reflectance in visible light; grain: wavelength of its finest octave [m], strength of that octave
#: as a share of the reflectance, strength of an octave over the next finer one. Vegetation is dark in visible
#: light and bright in near infrared. Typical values; extraction must not depend on them.
_TABLE: dict[Material, tuple[float, float, float, float]] = {
    Material.ASPHALT: (0.12, 0.008, 0.45, 0.50),
    Material.KERB: (0.26, 0.010, 0.25, 0.75),
    Material.FOOTWAY: (0.22, 0.010, 0.25, 0.75),
    Material.GRASS: (0.10, 0.020, 0.55, 0.75),
    Material.STEEL: (0.36, 0.050, 0.05, 1.00),
    Material.CONCRETE: (0.30, 0.020, 0.15, 0.90),
    Material.WOOD: (0.12, 0.020, 0.30, 0.80),
    Material.MESH: (0.20, 0.050, 0.00, 1.00),
    Material.LEAF: (0.06, 0.040, 0.30, 0.80),
    Material.CAR: (0.30, 0.100, 0.02, 1.00),
    Material.GLASS: (0.10, 0.300, 0.10, 1.00),
    Material.TYRE: (0.03, 0.050, 0.10, 1.00),
    Material.WALL: (0.32, 0.020, 0.12, 0.95),
    Material.WIRE: (0.08, 0.050, 0.00, 1.00),
    Material.POLE: (0.30, 0.050, 0.05, 1.00),
    Material.SIGN: (0.50, 0.200, 0.20, 1.00),
    Material.SOIL: (0.15, 0.015, 0.40, 0.75),
}
CAMERA_REFLECTANCE: FloatArray = np.array([_TABLE[m][0] for m in Material])
FINEST_M: FloatArray = np.array([_TABLE[m][1] for m in Material])
STRENGTH: FloatArray = np.array([_TABLE[m][2] for m in Material])
GROWTH: FloatArray = np.array([_TABLE[m][3] for m in Material])
N_OCTAVES = 8


@dataclass(frozen=True, slots=True)
class Seam:
    """A thin dark line on the carriageway: a tar seam along the road, a crack across it.

    Its middle is at ``place_m`` plus waves of amplitudes, wavelengths [m] and phases `waves` (k, 3).
    """

    is_along: bool
    place_m: float
    start_m: float
    end_m: float
    width_m: float
    darkness: float
    waves: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True)
class AsphaltPatch:
    """A rectangle of other asphalt; `shade` times as bright."""

    start_m: float
    end_m: float
    right_m: float
    left_m: float
    shade: float


@dataclass(frozen=True, slots=True)
class Wear:
    """What time did to a carriageway, and how coarse its asphalt is: `grain` times the usual contrast of stones."""

    seams: tuple[Seam, ...]
    patches: tuple[AsphaltPatch, ...]
    grain: float = 1.0


def draw_wear(layout: RoadLayout, length_m: float, rng: np.random.Generator) -> Wear:
    """Return patches every 15 to 100 m, seams and cracks every 5 to 50 m, over the whole carriageway."""
    right, left = -layout.road.right.width_m, layout.road.left.width_m
    ends = -6.0, length_m + 6.0
    patches, seams = [], []
    for _ in range(int(length_m / rng.uniform(15.0, 100.0))):
        s, q = rng.uniform(*ends), rng.uniform(right, left)
        long, wide = np.exp(rng.uniform(np.log(0.5), np.log(15.0))), rng.uniform(0.4, 2.5)
        patches.append(AsphaltPatch(s, s + long, q, min(q + wide, left), float(rng.uniform(0.75, 1.2))))
    for _ in range(int(length_m / rng.uniform(5.0, 50.0))):
        is_along = bool(rng.random() < 0.4)
        waves = tuple(
            (float(rng.uniform(0.02, 0.12) * w / 6.0), float(w), float(rng.uniform(0.0, 6.3)))
            for w in (0.5, 1.7, 6.0)
        )
        a, b = np.sort(rng.uniform(*(ends if is_along else (right, left)), 2))
        seams.append(
            Seam(
                is_along=is_along,
                place_m=float(rng.uniform(*((right, left) if is_along else ends))),
                start_m=float(a),
                end_m=float(min(b, a + 40.0)),
                width_m=float(rng.uniform(0.015, 0.06) if is_along else rng.uniform(0.005, 0.02)),
                darkness=float(rng.uniform(0.2, 0.6)),
                waves=waves,
            )
        )
    return Wear(tuple(seams), tuple(patches), float(np.exp(rng.uniform(np.log(0.6), np.log(1.7)))))


def pavement_shade(place: FloatArray, wide: FloatArray, wear: Wear) -> FloatArray:
    """Return the factor on the brightness of asphalt.

    Parameters
    ----------
    place, wide
        (n, 2) [m]: chainage and offset, and the extent of what is averaged there along each.
    """
    shade = np.ones(len(place))
    if len(place) == 0:
        return shade
    s, q = place[:, 0], place[:, 1]
    nearest, furthest = float(s.min()) - 0.5, float(s.max()) + 0.5
    for patch in wear.patches:
        if patch.end_m < nearest or patch.start_m > furthest:
            continue
        along = np.clip(np.minimum(s - patch.start_m, patch.end_m - s) / wide[:, 0] + 0.5, 0.0, 1.0)
        across = np.clip(np.minimum(q - patch.right_m, patch.left_m - q) / wide[:, 1] + 0.5, 0.0, 1.0)
        shade *= 1.0 + (patch.shade - 1.0) * along * across
    for seam in wear.seams:
        start, end = (seam.start_m, seam.end_m) if seam.is_along else (seam.place_m, seam.place_m)
        if end < nearest or start > furthest:
            continue
        x, y, i = (s, q, 1) if seam.is_along else (q, s, 0)
        reach = 0.3 + seam.width_m
        near = np.flatnonzero(
            (np.abs(y - seam.place_m) < reach + wide[:, i]) & (x > seam.start_m) & (x < seam.end_m)
        )
        middle = seam.place_m + sum(a * np.sin(6.2832 * x[near] / w + p) for a, w, p in seam.waves)
        w = np.maximum(wide[near, i], 0.002)
        inside = np.clip((0.5 * seam.width_m - np.abs(y[near] - middle)) / w + 0.5, 0.0, 1.0)
        shade[near] *= 1.0 - seam.darkness * np.minimum(inside, seam.width_m / w)
    return shade


def reflectances(scene: Scene, layout: RoadLayout, asphalt: float, rng: np.random.Generator) -> FloatArray:
    """Return the reflectance of each triangle: every leaf, wall and car its own."""
    mesh = scene.mesh
    value: FloatArray = CAMERA_REFLECTANCE[mesh.material].copy()
    value[mesh.material == Material.ASPHALT] = asphalt
    leaf = mesh.material == Material.LEAF
    value[leaf] *= np.exp(rng.normal(0.0, 0.5, int(leaf.sum())))
    value *= np.exp(rng.normal(0.0, 0.15, len(Material)))[mesh.material] ** (
        mesh.material != Material.ASPHALT
    )
    body = np.flatnonzero(mesh.material == Material.CAR)
    if len(body):
        road = layout.road
        middle = np.array([road.on_ground(c.s_m, c.q_m) for c in layout.cars])
        paint = rng.choice([0.03, 0.06, 0.12, 0.25, 0.45, 0.75], len(middle))
        away = mesh.vertices[mesh.triangles[body, 0], None, :2] - middle[None, :, :2]
        value[body] = paint[np.argmin(np.sum(away**2, axis=2), axis=1)]
    return np.asarray(value)


# Light and exposure of a simulated drive: what the seed decides about every image


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """Sun, sky and how the cameras are set.

    Parameters
    ----------
    to_sun
        (3,) unit vector, local frame.
    sun
        Light of the sun on a surface that faces it, over that of the sky on level ground; 0: overcast.
    asphalt_grey
        Grey value of lit asphalt, which decides the exposure.
    asphalt
        Reflectance of the asphalt.
    contrast
        Reflectance of paint over that of asphalt.
    glare
        How much asphalt mirrors at grazing angles.
    noise_grey
        Standard deviation of the noise on lit asphalt. [grey values]
    blur_px
        Standard deviation of the lens's blur. [pixels]
    exposure_s
        How long the shutter is open.
    gain_right
        Grey values of the right camera over those of the left one.
    vignetting
        Share of the light that is lost in a corner.
    """

    to_sun: FloatArray
    sun: float
    asphalt_grey: float
    asphalt: float
    contrast: float
    glare: float
    noise_grey: float
    blur_px: float
    exposure_s: float
    gain_right: float
    vignetting: float

    @property
    def gain(self) -> float:
        """Grey values per unit of light that comes from a surface (reflectance 1 under the open sky alone: 1)."""
        return self.asphalt_grey / (self.asphalt * (1.0 + self.sun * max(float(self.to_sun[2]), 0.0)))


def draw_light(rng: np.random.Generator) -> Light:
    """Return what a seed decides; ranges beside each.

    Direct light over diffuse: 3 to 8 under a clear sky. Outdoor exposures are 1 to 4 ms.
    """
    elevation, azimuth = np.radians(rng.uniform(10.0, 70.0)), rng.uniform(0.0, 2.0 * np.pi)
    is_overcast = rng.random() < 0.35
    to_sun = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    return Light(
        to_sun=np.array(to_sun),
        sun=float(rng.uniform(3.0, 8.0)) * (not is_overcast),
        asphalt_grey=float(rng.uniform(60.0, 110.0)),
        asphalt=float(rng.uniform(0.09, 0.16)),
        contrast=float(rng.uniform(1.3, 4.0)),
        glare=float(rng.uniform(0.0, 0.5)),
        noise_grey=float(rng.uniform(1.0, 4.0)),
        blur_px=float(rng.uniform(0.4, 1.0)),
        exposure_s=float(rng.uniform(0.001, 0.004)),
        gain_right=float(rng.uniform(0.93, 1.07)),
        vignetting=float(rng.uniform(0.0, 0.25)),
    )


def sky_and_hills(direction: FloatArray, light: Light, pixel_rad: float, seed: int) -> FloatArray:
    """Return the light from (n, 3) directions that meet nothing of the scene: wooded hills, above them the sky."""
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    # Mirrored, so that west has no seam
    azimuth, elevation = np.abs(np.arctan2(unit[:, 1], unit[:, 0])), np.arcsin(unit[:, 2])
    n, level, fine = len(unit), np.zeros(len(unit)), np.full(len(unit), pixel_rad)

    def noise(finest_rad: float, growth: float, n_octaves: int, salt: int, y: FloatArray) -> FloatArray:
        return grain(
            azimuth, y, fine, fine, np.full(n, finest_rad), np.full(n, growth), n_octaves, seed + salt
        )

    ridge = np.radians(3.0) + 0.004 * noise(0.01, 1.5, 6, 1, level)
    woods = (
        0.055
        * (1.0 + 0.5 * light.sun * abs(light.to_sun[2]))
        * np.exp(0.2 * noise(0.002, 1.1, 6, 2, elevation))
    )
    clouds = 1.0 + 0.03 * noise(0.01, 1.4, 6, 3, 3.0 * elevation)
    towards_sun = np.clip(unit @ light.to_sun, 0.0, 1.0) ** 6 * (light.sun > 0.0)
    sky = clouds * (0.8 + 0.8 * np.exp(-np.maximum(elevation, 0.0) / 0.25)) * (1.0 + 1.5 * towards_sun)
    share = np.clip((ridge - elevation) / pixel_rad + 0.5, 0.0, 1.0)
    return np.asarray(share * woods + (1.0 - share) * sky)
