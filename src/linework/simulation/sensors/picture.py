"""The picture a camera takes of the scene: rays, light, grain, lens, shutter, noise, grey values.

Separate from `cameras`, which decides when and where pictures are taken: this computes the grey values of one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.kernels.images.grain import grain
from linework.model.camera import Camera
from linework.model.images import Poses
from linework.simulation.scene.materials import GROUND, Material
from linework.simulation.scene.paint import paint_cover
from linework.simulation.sensors.view import PassScene, horizontal, pixel_offsets, pixel_rays
from linework.simulation.sensors.visible import (
    FINEST_M,
    GROWTH,
    N_OCTAVES,
    STRENGTH,
    Light,
    Wear,
    pavement_shade,
    sky_and_hills,
)

#: Rays processed at a time: their arrays stay in the processor's cache and under 20 MB.
_BATCH = 40_000


@dataclass(frozen=True, slots=True)
class Stage:
    """The scene and its light, the same for all images.

    Parameters
    ----------
    view, light, wear
        The scene, its light, and the state of its carriageway.
    reflectance
        (k,) reflectance of each triangle.
    seed
        Random seed of the grain.
    """

    view: PassScene
    light: Light
    wear: Wear
    reflectance: FloatArray
    seed: int


class Shutter:
    """Renderer of the images of one camera in one scene."""

    def __init__(self, stage: Stage, camera: Camera, rays_per_pixel: int) -> None:
        self._stage, self._camera = stage, camera
        self._offsets = pixel_offsets(rays_per_pixel)
        self._rays = [pixel_rays(camera, o).reshape(-1, 3).astype(np.float32) for o in self._offsets]

    def light_at(self, poses: Poses) -> FloatArray:
        """Return the (height, width) light that enters: the mean over the rays of a pixel, each at its own time.

        Parameters
        ----------
        poses
            One pose for each ray of a pixel: that of the vehicle during its part of the exposure, local frame.
        """
        camera, stage = self._camera, self._stage
        total = np.zeros(camera.height * camera.width)
        for k, rays in enumerate(self._rays):
            origin = poses.to_world(k, camera.position_m[None])[0]
            turn = poses.R_world_vehicle[k]
            axes = (turn @ camera.R_vehicle_camera)[:, :2] / np.array([camera.fx, camera.fy])
            for first in range(0, len(rays), _BATCH):
                part = slice(first, first + _BATCH)
                direction = rays[part].astype(np.float64) @ turn.T
                # Wire mesh covers about 3 of 10 lines of sight
                through = (np.arange(first, first + len(direction)) * 7 + 3 * k) % 10 >= 3
                total[part] += _light_from(stage, origin, direction, through, axes / np.sqrt(len(self._rays)))
        return np.asarray(total / len(self._rays)).reshape(camera.height, camera.width)

    def grey(self, light: FloatArray, gain: float, rng: np.random.Generator) -> AnyArray:
        """Return the (height, width) uint8 image: with blur, vignetting, photon noise and read noise."""
        from scipy.ndimage import gaussian_filter

        look, camera = self._stage.light, self._camera
        row, col = np.mgrid[: camera.height, : camera.width]
        corner = 0.25 * (camera.width**2 + camera.height**2)
        away = ((col - camera.cx) ** 2 + (row - camera.cy) ** 2) / corner
        value = (
            gain
            * gaussian_filter(np.maximum(light, 0.0), look.blur_px, truncate=4.0)
            * (1.0 - look.vignetting * away)
        )
        # On asphalt, three tenths of the variance are read noise; the rest is proportional to the light
        sigma = look.noise_grey * np.sqrt(0.3 + 0.7 * np.minimum(value / look.asphalt_grey, 4.0))
        value += sigma * rng.standard_normal(value.shape)
        return np.asarray(np.clip(np.rint(value), 0.0, 255.0), dtype=np.uint8)


def _light_from(
    stage: Stage, origin: FloatArray, direction: FloatArray, through: AnyArray, axes: FloatArray
) -> FloatArray:
    """Return the light that comes along (n, 3) rays; `axes` (3, 2): change of direction over a ray's share of a pixel."""
    met = stage.view.look(origin, direction, through)
    is_hit = met.triangle >= 0
    light = np.empty(len(direction))
    miss, hit = np.flatnonzero(~is_hit), np.flatnonzero(is_hit)
    pixel_rad = float(np.linalg.norm(axes[:, 0])) * 2.0
    if len(miss):
        light[miss] = sky_and_hills(direction[miss], stage.light, pixel_rad, stage.seed)
    if len(hit):
        light[hit] = _reflected(stage, origin, direction[hit], (met.triangle[hit], met.depth[hit]), axes)
    return light


def _reflected(
    stage: Stage,
    origin: FloatArray,
    direction: FloatArray,
    met: tuple[AnyArray, FloatArray],
    axes: FloatArray,
) -> FloatArray:
    """Return the light from surfaces: reflectance with grain and paint, lit by the sun and the sky."""
    triangle, depth = met
    view, look = stage.view, stage.light
    material = view.scene.mesh.material[triangle]
    normal = view.normal[triangle]
    towards = np.sum(normal * direction, axis=1)
    xyz = origin + direction * depth[:, None]
    # How far the place moves on the surface over a ray's share of a pixel, along columns and rows
    steps = [
        depth[:, None] * (axis - direction * ((normal @ axis) / np.where(np.abs(towards) < 1e-6, 1e-6, towards))[:, None])
        for axis in axes.T
    ]  # fmt: skip
    place, wide = _surface_places(view, triangle, material, xyz, steps)
    strength = STRENGTH[material] * np.where(material == Material.ASPHALT, stage.wear.grain, 1.0)
    # Bright specks on a darker ground, like stones in their binder: skewed above the mean
    shade = np.exp(strength * grain(
        place[:, 0], place[:, 1], wide[:, 0], wide[:, 1], FINEST_M[material], GROWTH[material], N_OCTAVES,
        stage.seed,
    ))  # fmt: skip
    reflectance = stage.reflectance[triangle] * shade
    asphalt = np.flatnonzero(material == Material.ASPHALT)
    reflectance[asphalt] *= pavement_shade(place[asphalt], wide[asphalt], stage.wear)
    layout = view.scenario.layout
    cover = paint_cover(
        place[asphalt], layout.all_markings, view.scenario.seed, layout.symbols, edge_m=wide[asphalt]
    )
    paint = look.asphalt * look.contrast * (0.5 + 0.5 * shade[asphalt])
    reflectance[asphalt] += cover * (paint - reflectance[asphalt])
    # The normal of the side that faces the camera
    facing = np.where(towards[:, None] > 0.0, -normal, normal)
    return np.asarray(_lit(stage, xyz, direction, facing, (material, reflectance)))


def _surface_places(
    view: PassScene, triangle: AnyArray, material: AnyArray, xyz: FloatArray, steps: list[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) places on surfaces [m] and the extent of a ray's share of a pixel there [m].

    On the ground: along and across the road; on everything else: sideways and up.
    """
    place, wide = np.empty((len(xyz), 2)), np.empty((len(xyz), 2))
    on = GROUND[material]
    ground, other = np.flatnonzero(on), np.flatnonzero(~on)
    place[ground] = view.place(triangle[ground], xyz[ground])
    slope = view.place_slope[triangle[ground]]
    wide[ground] = sum(np.abs(np.einsum("kij,kj->ki", slope, step[ground])) for step in steps)
    along = horizontal(view.normal[triangle[other]])
    place[other, 0] = np.sum(along * xyz[other, :2], axis=1)
    place[other, 1] = xyz[other, 2] + 0.31 * (along[:, 1] * xyz[other, 0] - along[:, 0] * xyz[other, 1])
    wide[other, 0] = sum(np.abs(np.sum(along * step[other, :2], axis=1)) for step in steps)
    wide[other, 1] = sum(np.abs(step[other, 2]) for step in steps)
    return place, np.maximum(wide, 0.002)


def _lit(
    stage: Stage,
    xyz: FloatArray,
    direction: FloatArray,
    normal: FloatArray,
    surface: tuple[AnyArray, FloatArray],
) -> FloatArray:
    """Return the light of surfaces under sun and sky (Lambert), and the glare of asphalt towards the sun."""
    material, reflectance = surface
    look = stage.light
    # The ground reflects a tenth of the sky's light onto surfaces that face down
    ambient = 0.55 + 0.45 * normal[:, 2]
    light = reflectance * ambient
    if look.sun > 0.0:
        # Leaves let light through: they have no dark side
        leaf = material == Material.LEAF
        facing = np.where(leaf[:, None] & (normal @ look.to_sun < 0.0)[:, None], -normal, normal)
        lit = look.sun * stage.view.is_lit(xyz, facing, look.to_sun)
        light += reflectance * lit * np.maximum(facing @ look.to_sun, 0.0)
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        graze = np.sum(unit * normal, axis=1)
        mirrored = np.clip((unit - 2.0 * graze[:, None] * normal) @ look.to_sun, 0.0, 1.0)
        light += look.glare * lit * 0.1 * (1.0 - np.abs(graze)) ** 3 * mirrored**8 * GROUND[material]
    # Glass mirrors some of the sky
    return np.asarray(light + 0.12 * (material == Material.GLASS))
