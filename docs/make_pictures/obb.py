"""Make the picture of docs/methods/obb.md from a simulated survey: ``python docs/make_pictures/obb.py``."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from PIL import Image

from linework.evaluation.report.scores_figure import plot_png
from linework.imaging.brightness import brightness_picture, near_ground
from linework.methods.obb.method import Obb
from linework.methods.protocol import SurveyContext, sight_of
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LineSet
from linework.model.tile import TileData, local_origin
from linework.simulation.simulate import simulate_survey
from linework.surface.config import RoadConfig
from linework.surface.road import find_ground

PICTURES = Path(__file__).parents[1] / "pictures"
#: Half the stretch of street that is shown, along and across. [m]
HALF_M = (17.0, 8.5)
COLOURS = {
    BoxForm.STRIPE: "#1f77ff", BoxForm.OTHER_PAINT: "#00b0b0", BoxForm.KERB: "#e00000",
    BoxForm.EDGE: "#ff8800", BoxForm.BARRIER: "#a000c0",
}  # fmt: skip


def corners(boxes: BoxSet, origin: np.ndarray, turn: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the outlines of boxes (n, 5, 2) in the picture."""
    left = np.column_stack([-boxes.u[:, 1], boxes.u[:, 0]])
    signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)])
    outline = (
        boxes.centre[:, None, :2]
        + signs[None, :, :1] * (boxes.half_u_m[:, None] * boxes.u)[:, None]
        + signs[None, :, 1:] * (boxes.half_v_m[:, None] * left)[:, None]
    )
    return (outline + origin[:2] - centre) @ turn


def run() -> int:
    """Write docs/pictures/obb_plan.png."""
    survey = simulate_survey("urban", 2, 100.0)
    points, bounds = survey.points, survey.points.bounds
    surface = find_ground(points, survey.trajectory, RoadConfig())
    origin = local_origin(bounds.west, bounds.south, surface.z0_m)
    method = Obb()
    tile = TileData("picture", bounds.grown(1.0), points, survey.trajectory, "", surface, origin)
    boxes = method.look(tile)
    context = SurveyContext(origin=origin, is_visible=sight_of(surface), path=survey.trajectory.xyz)
    lines = method.join(boxes, context)
    centre = survey.trajectory.xyz[len(survey.trajectory.xyz) // 2, :2]
    way = np.diff(survey.trajectory.xyz[len(survey.trajectory.xyz) // 2 :: 200, :2], axis=0)[0]
    way /= np.linalg.norm(way)
    turn = np.column_stack([way, [-way[1], way[0]]])
    figure = drawn(points, boxes, lines, np.asarray(origin), turn, centre)
    picture = Image.open(io.BytesIO(plot_png(figure))).convert("RGB")
    picture.quantize(64, dither=Image.Dither.NONE).save(PICTURES / "obb_plan.png", optimize=True)
    return 0


def drawn(points, boxes: BoxSet, lines: LineSet, origin, turn, centre) -> Figure:
    """Return the figure."""
    figure = Figure(figsize=(11, 5.8), layout="constrained")
    ax = figure.add_subplot()
    places = (points.xyz[:, :2] - centre) @ turn
    inside = np.all(np.abs(places) < HALF_M, axis=1)
    points, places = points.take(inside), places[inside]
    low = near_ground(points.xyz)
    box = (-HALF_M[0], HALF_M[0]), (-HALF_M[1], HALF_M[1])
    picture = brightness_picture(places[low], points.intensity[low], box, 0.04)
    ax.imshow(picture, origin="lower", extent=[*box[0], *box[1]], cmap="gray", vmin=0, vmax=1)
    for form, colour in COLOURS.items():
        own = boxes.take(boxes.form == form)
        ax.add_collection(LineCollection(corners(own, origin, turn, centre), colors=colour, lw=0.7))
    for i in range(len(lines)):
        if str(lines.kind[i]) in ("lane_marking", "road_boundary"):
            ax.plot(*((lines[i].xyz[:, :2] - centre) @ turn).T, color="#ffe000", lw=1.0)
    ax.set(xlim=box[0], ylim=box[1], aspect="equal", xlabel="along the street [m]", ylabel="across [m]")
    return figure


if __name__ == "__main__":
    raise SystemExit(run())
