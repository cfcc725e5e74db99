"""A piece of the world: triangles and the truth lines that belong to them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.scene.meshes import Mesh, joined_meshes


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthLine:
    """One exact line, local frame, with the fields of its layer (see `linework.model.lines.LineSet`)."""

    kind: str
    xyz: FloatArray
    role: str = ""
    pattern: str = ""
    form: str = ""
    double: bool = False
    width_m: float = float("nan")
    height_m: float = float("nan")
    lower_m: float = float("nan")
    n_beams: float = float("nan")
    clearance_m: float = float("nan")


@dataclass(frozen=True, slots=True)
class Part:
    """Meshes whose `target` counts within `lines`."""

    meshes: tuple[Mesh, ...]
    lines: tuple[TruthLine, ...] = ()
    wire_segments: FloatArray | None = None
    wire_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Scene:
    """The whole world of a survey, local frame.

    Parameters
    ----------
    mesh
        All triangles.
    lines
        All truth lines; `mesh.target` counts in them.
    wire_segments
        (w, 2, 3) float64 [m, local]: axis of each wire segment; `mesh.wire` counts in them.
    wire_m
        (w,) float64 [m]: thickness of each wire.
    """

    mesh: Mesh
    lines: tuple[TruthLine, ...]
    wire_segments: FloatArray
    wire_m: FloatArray


def assemble_scene(parts: Iterable[Part]) -> Scene:
    """Return the scene of all parts, targets and wires counted through."""
    meshes: list[Mesh] = []
    lines: list[TruthLine] = []
    wires: list[FloatArray] = [np.zeros((0, 2, 3))]
    thickness: list[float] = []
    n_wires = 0
    for part in parts:
        for mesh in part.meshes:
            target = np.where(mesh.target >= 0, mesh.target + np.int32(len(lines)), np.int32(-1))
            wire = np.where(mesh.wire >= 0, mesh.wire + np.int32(n_wires), np.int32(-1))
            meshes.append(replace(mesh, target=target.astype(np.int32), wire=wire.astype(np.int32)))
        lines += part.lines
        if part.wire_segments is not None:
            wires.append(part.wire_segments)
            n_wires += len(part.wire_segments)
            thickness += [part.wire_m] * len(part.wire_segments)
    return Scene(joined_meshes(meshes), tuple(lines), np.concatenate(wires), np.array(thickness))
