"""Make the pictures of docs/methods/stereo.md from a simulated drive: ``python docs/make_pictures/stereo.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from linework.evaluation.report.scores_figure import plot_png
from linework.imaging.rectify import rectifier_of
from linework.kernels.images.row_stripes import COL, ROW, WIDTH
from linework.methods.protocol import SurveyContext
from linework.methods.stereo.method import Stereo
from linework.methods.stereo.road_plane import fit_pair_road
from linework.methods.stereo.stripes import StripeConfig, find_stripe_lines
from linework.model.images import RectifiedPair
from linework.model.lines import LineSet
from linework.model.sightings import Sightings
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.cameras import StereoDrive, images_of, stereo_survey

PICTURES = Path(__file__).parents[1] / "pictures"
ROAD, SEED, LENGTH_M, SHOWN = "straight", 1, 50.0, 2
ON_LINE, ALONE, SEEN = "#ffe000", "#1f77ff", "#00d060"
#: Rows above the horizon that are shown; grey values are lifted to this power for paper and screens.
ABOVE, GAMMA = 20, 0.65


def run() -> int:
    """Write docs/pictures/stereo_pair.png and stereo_plan.png."""
    drive = stereo_survey(draw_scenario(ROAD, SEED, LENGTH_M), every_m=4.0)
    rectifier, method = rectifier_of(drive.rig), Stereo()
    pairs = [
        RectifiedPair(*rectifier.rectified(p.left, p.right), rectifier.rig, p.number, p.time_s)
        for p in images_of(drive)
    ]
    seen = Sightings.concatenate(map(method.look, pairs))
    lines = method.join(seen, SurveyContext(poses=drive.poses, rig=rectifier.rig))
    pair = pairs[SHOWN]
    drawn = [stripes_drawn(pair), places_drawn(pair, seen.take(seen.pair == pair.number))]
    stacked(drawn).quantize(128, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(
        PICTURES / "stereo_pair.png", optimize=True
    )
    (PICTURES / "stereo_plan.png").write_bytes(plot_png(plan(drive, seen, lines)))
    return 0


def shown(pair: RectifiedPair, left: bool) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """Return one image of a pair to draw on."""
    grey = 255.0 * ((pair.left if left else pair.right) / 255.0) ** GAMMA
    image = Image.fromarray(grey.astype(np.uint8)).convert("RGB")
    return image, ImageDraw.Draw(image)


def cut(image: Image.Image, pair: RectifiedPair) -> Image.Image:
    """Return the image without the sky."""
    return image.crop((0, max(int(pair.rig.cy) - ABOVE, 0), image.width, image.height))


def stripes_drawn(pair: RectifiedPair) -> Image.Image:
    """Return the left image with its stripes, row by row: those of lines, and those that stand alone."""
    road = fit_pair_road(pair)
    assert road is not None, "the drawn road is seen"
    lines = find_stripe_lines(pair, road, StripeConfig())
    n = np.bincount(lines.line[lines.line >= 0])
    image, draw = shown(pair, left=True)
    for place, number in zip(lines.table, lines.line.tolist(), strict=True):
        colour = ON_LINE if number >= 0 and n[number] >= 4 else ALONE
        y = place[ROW]
        half = 0.5 * place[WIDTH]
        draw.line([(place[COL] + s * half, y) for s in (-1, 1)], fill=colour, width=1)
    return cut(image, pair)


def places_drawn(pair: RectifiedPair, seen: Sightings) -> Image.Image:
    """Return the right image with the places that were intersected."""
    image, draw = shown(pair, left=False)
    for number in np.unique(seen.line).tolist():
        own = seen.take(seen.line == number)
        x, y = own.col - own.disparity, own.row
        draw.line(list(zip(x.tolist(), y.tolist(), strict=True)), fill=SEEN, width=2)
        for a, b in zip(x.tolist(), y.tolist(), strict=True):
            draw.ellipse((a - 2, b - 2, a + 2, b + 2), outline=SEEN)
    return cut(image, pair)


def stacked(images: list[Image.Image]) -> Image.Image:
    """Return images one below the other."""
    out = Image.new("RGB", (images[0].width, sum(i.height + 4 for i in images) - 4), "white")
    top = 0
    for image in images:
        out.paste(image, (0, top))
        top += image.height + 4
    return out


def plan(drive: StereoDrive, seen: Sightings, lines: LineSet) -> Figure:
    """Return the plan: what each pair saw, and the lines through it."""
    poses = drive.poses
    way = poses.xyz[-1, :2] - poses.xyz[0, :2]
    way /= np.linalg.norm(way)
    turn = np.column_stack([way, [-way[1], way[0]]])
    figure = Figure(figsize=(9, 2.8), layout="constrained")
    ax = figure.add_subplot()
    for number in np.unique(seen.pair).tolist():
        own = seen.take(seen.pair == number)
        xy = (poses.to_world(number, own.xyz)[:, :2] - poses.xyz[0, :2]) @ turn
        ax.plot(*xy.T, ".", ms=2, color="0.6")
    for i in range(len(lines)):
        xy = (lines[i].xyz[:, :2] - poses.xyz[0, :2]) @ turn
        is_dash = str(lines.kind[i]) == "lane_marking_dash"
        ax.add_collection(
            LineCollection([xy], colors="#e00000" if is_dash else "#1f77ff", lw=3 if is_dash else 1)
        )
    ax.plot(*((poses.xyz[:, :2] - poses.xyz[0, :2]) @ turn).T, "k+", ms=6)
    ax.set(xlim=(0, LENGTH_M + 10), ylim=(-7, 9), xlabel="along the road [m]", ylabel="across [m]")
    return figure


if __name__ == "__main__":
    raise SystemExit(run())
