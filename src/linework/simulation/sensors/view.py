"""The scene made ready for cameras: what a ray meets first, and whether the sun shines there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.errors import UsageError, argument, extra_needed
from linework.imaging.rectify import distorted
from linework.model.camera import LOOKING_AHEAD, Camera, StereoRig
from linework.simulation.roads.scenario import Scenario, Wall
from linework.simulation.scene.materials import Material
from linework.simulation.scene.part import Scene
from linework.simulation.scene.scene import build_scene

#: Nothing is looked at beyond this. [m]
SIGHT_REACH_M = 400.0
#: Shadow rays start this far from where they were cast off, so that a surface does not shade itself. [m]
_CLEAR_M = 0.01
#: Windows are set back by a little less.
_REVEAL_M = 0.13


@dataclass(frozen=True, slots=True)
class RayHits:
    """What n rays met.

    Parameters
    ----------
    triangle
        (n,) int: index into the scene's mesh, -1: nothing.
    depth
        (n,) float64: in units of the ray's direction.
    """

    triangle: AnyArray
    depth: FloatArray


class PassScene:
    """The scene of one pass for cameras; vehicles have their own length again."""

    def __init__(self, scenario: Scenario, i_pass: int = 0) -> None:
        layout = scenario.layout
        cars = tuple(replace(c, stretch=1.0) for c in layout.cars if c.only_pass in (-1, i_pass))
        walls = (*layout.walls, *(_behind(w) for w in layout.walls if w.is_facade))
        self.scenario = replace(scenario, layout=replace(layout, cars=cars, walls=walls))
        self.scene: Scene = build_scene(self.scenario)
        mesh = self.scene.mesh
        self._all = _Rays(mesh.vertices, mesh.triangles)
        # Mesh of wire hardly shades, and hides by chance only
        self._solid_index = np.flatnonzero(mesh.material != Material.MESH)
        self._solid = _Rays(mesh.vertices, mesh.triangles[self._solid_index])
        a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        area = np.maximum(np.sum(normal * normal, axis=1), 1e-30)
        self.normal: FloatArray = normal / np.sqrt(area)[:, None]
        self._level = np.sum(self.normal * a, axis=1)
        # Chainage and offset of a place on a triangle: linear in it
        pa, pb, pc = (mesh.chainage_offset[mesh.triangles[:, i]] for i in range(3))
        along_b, along_c = (np.cross(e, f) / area[:, None] for e, f in ((c - a, normal), (normal, b - a)))
        self.place_slope: FloatArray = (pb - pa)[:, :, None] * along_b[:, None] + (pc - pa)[
            :, :, None
        ] * along_c[:, None]
        self._place_level = pa - np.einsum("kij,kj->ki", self.place_slope, a)

    def look(self, origin: FloatArray, direction: FloatArray, through_mesh: BoolArray) -> RayHits:
        """Return what (n, 3) rays from one place meet; those of `through_mesh` pass wire mesh."""
        triangle = self._all.first(origin, direction)
        mesh = self.scene.mesh
        on = np.flatnonzero((triangle >= 0) & (mesh.material[triangle] == Material.MESH) & through_mesh)
        if len(on):
            behind = self._solid.first(origin, direction[on])
            triangle[on] = np.where(behind >= 0, self._solid_index[behind], -1)
        normal = self.normal[triangle]
        slope = np.sum(normal * direction, axis=1)
        slope = np.where(np.abs(slope) < 1e-9, 1e-9, slope)
        return RayHits(triangle, (self._level[triangle] - normal @ origin) / slope)

    def place(self, triangle: AnyArray, xyz: FloatArray) -> FloatArray:
        """Return (n, 2) chainage and offset of places on ground triangles."""
        return np.asarray(
            np.einsum("kij,kj->ki", self.place_slope[triangle], xyz) + self._place_level[triangle]
        )

    def is_lit(self, xyz: FloatArray, normal: FloatArray, to_sun: FloatArray) -> BoolArray:
        """Return where the sun is not hidden; `normal` points to the side that is looked at."""
        faces = np.flatnonzero(normal @ to_sun > 0.0)
        lit = np.zeros(len(xyz), dtype=np.bool_)
        start = xyz[faces] + _CLEAR_M * (normal[faces] + to_sun)
        lit[faces] = self._solid.first(start, np.broadcast_to(to_sun, start.shape)) < 0
        return lit

    def is_hidden(self, origin: FloatArray, xyz: FloatArray) -> BoolArray:
        """Return which of (n, 3) places something hides from one place; wire mesh hides nothing."""
        return np.asarray(self._solid.first(origin, xyz - origin, 0.999) >= 0)


def _behind(facade: Wall) -> Wall:
    """Return what stands behind a facade, so that no sky shines through beside its windows."""
    q = facade.q_m + np.sign(facade.q_m) * _REVEAL_M
    return replace(facade, q_m=q, height_m=facade.height_m - 0.5, is_facade=False)


class _Rays:
    """Triangles ready for rays; near the origin single precision is good to 0.1 mm."""

    def __init__(self, vertices: FloatArray, triangles: AnyArray) -> None:
        with extra_needed("simulate"):
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene

        self._embree = EmbreeScene()
        self._mesh = TriangleMesh(self._embree, vertices.astype(np.float32), triangles)

    def first(self, origin: FloatArray, direction: FloatArray, reach: float = SIGHT_REACH_M) -> AnyArray:
        """Return the index of the first triangle of each ray within `reach` of its lengths, or -1."""
        if len(direction) == 0:
            return np.zeros(0, dtype=np.int64)
        start = np.ascontiguousarray(np.broadcast_to(origin, direction.shape), dtype=np.float32)
        far = np.full(len(direction), reach, dtype=np.float32)
        return np.asarray(self._embree.run(start, direction.astype(np.float32), dists=far), dtype=np.int64)


def horizontal(normals: FloatArray) -> FloatArray:
    """Return the level direction along surfaces with these normals; east where they are level themselves."""
    along = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.where(length > 0.05, along / np.maximum(length, 1e-9), np.array([[1.0, 0.0]])))


# Stereo cameras on simulated vans, and where each of their pixels looks


@dataclass(frozen=True, slots=True)
class Mount:
    """A kind of rig: its images, its base, its place on the vehicle, and the range of how far it is tilted down."""

    size: tuple[int, int]
    focal_px: float
    horizon: float
    base_m: float
    position_m: tuple[float, float, float]
    down_deg: tuple[float, float]


#: The cameras of He and Novak's van (Cohu 4110: 732 x 484) on its roof, and those of a car like KITTI's.
MOUNTS: dict[str, Mount] = {
    "732x484": Mount((732, 484), 820.0, 0.5, 1.2, (1.5, 0.0, 2.3), (3.0, 7.0)),
    "1240x376": Mount((1240, 376), 718.0, 0.49, 0.54, (1.6, 0.0, 1.65), (-1.0, 2.0)),
}
SIZES = tuple(MOUNTS)


def draw_rig(size: str, rng: np.random.Generator, *, is_ideal: bool = False) -> StereoRig:
    """Return the cameras of one van.

    Parameters
    ----------
    size
        "732x484" or "1240x376".
    is_ideal
        Without distortion, looking exactly the same way: images need no rectification.

    Notes
    -----
    Each camera is turned by up to 1 degree about each axis against the other; k1 is -0.3 to -0.05 (barrel, as of
    wide lenses), p1 and p2 up to 0.001, the principal point up to 10 pixels off the middle.
    """
    if size not in MOUNTS:
        raise UsageError(f"there are no cameras of {size!r}", where=argument("image_size"),
                         advice=f"choose one of {', '.join(SIZES)}")  # fmt: skip
    mount = MOUNTS[size]
    tilt = np.radians([-rng.uniform(*mount.down_deg), *rng.uniform(-1.0, 1.0, 2)])
    common = LOOKING_AHEAD @ Rotation.from_euler("XYZ", tilt).as_matrix()
    cameras = []
    for side in (0.5, -0.5):
        turn = np.radians(rng.uniform(-0.5, 0.5, 3))
        k1, off = float(rng.uniform(-0.30, -0.05)), rng.uniform(-10.0, 10.0, 2).tolist()
        k2 = float(rng.uniform(0.3, 0.6)) * -k1
        p1, p2 = rng.uniform(-0.001, 0.001, 2).tolist()
        focal = mount.focal_px * (1.0 + 0.005 * float(rng.uniform(-1.0, 1.0)))
        place = np.asarray(mount.position_m) + side * mount.base_m * -common[:, 0]
        width, height = mount.size
        cx, cy = 0.5 * (width - 1), mount.horizon * height
        cameras.append(
            Camera(width=width, height=height, fx=mount.focal_px, fy=mount.focal_px, cx=cx, cy=cy,
                   position_m=place, R_vehicle_camera=common)
            if is_ideal
            else Camera(width=width, height=height, fx=focal, fy=focal, cx=cx + off[0], cy=cy + off[1],
                        distortion=(k1, k2, p1, p2, 0.0), position_m=place,
                        R_vehicle_camera=common @ Rotation.from_rotvec(turn).as_matrix())
        )  # fmt: skip
    return StereoRig(*cameras)


def undistorted(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Return the directions x/z, y/z in the camera frame that (..., 2) pixels show.

    Newton's method on `distorted` with the Jacobian of an ideal lens; for the lenses drawn here each step leaves
    under half the error, so that 40 leave less than 1e-9 pixel.
    """
    scale, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    ideal = (pixels - middle) / scale
    for _ in range(40 if any(camera.distortion) else 0):
        ideal = ideal - (distorted(camera, ideal) - pixels) / scale
    return np.asarray(ideal)


def pixel_offsets(n: int) -> FloatArray:
    """Return (n, 3) where in a pixel, and when in the exposure, its n rays look: column, row, time in -0.5 to 0.5.

    Columns are evenly spaced, rows and times a golden-ratio sequence each; their means are exactly 0, so that
    nothing is displaced.
    """
    k = np.arange(n)
    offsets = np.stack(
        [(k + 0.5) / n, (k * 0.6180339887 + 0.5 / n) % 1.0, (k * 0.7548776662 + 0.5) % 1.0], axis=1
    )
    return np.asarray(offsets - offsets.mean(axis=0))


def pixel_rays(camera: Camera, offset: FloatArray) -> FloatArray:
    """Return (height, width, 3) directions [vehicle] of all pixels, moved by `offset` (col, row); depth 1."""
    # A lens is so smooth that cubic splines over 8 pixels leave it by less than 0.00001 pixel
    rows, cols = (np.arange(-8.0, n + 9.0, 8.0) for n in (camera.height, camera.width))
    nodes = undistorted(camera, np.stack(np.meshgrid(cols, rows), axis=-1))
    row, col = np.arange(camera.height) + offset[1], np.arange(camera.width) + offset[0]
    x, y = (RectBivariateSpline(rows, cols, nodes[..., i])(row, col) for i in (0, 1))
    return np.asarray(np.stack([x, y, np.ones(x.shape)], axis=-1) @ camera.R_vehicle_camera.T)
