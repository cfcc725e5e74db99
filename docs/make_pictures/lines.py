"""Make the pictures of the README from a simulated survey: ``python docs/make_pictures/lines.py``."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from linework.cli.app import main
from linework.evaluation.report.cuts import kerb_cuts, kerb_figure, marking_cuts, marking_figure
from linework.evaluation.report.plan import plan_figure
from linework.evaluation.report.scores_figure import plot_png
from linework.evaluation.report.sections import cable_figure, cable_section, rail_figure, rail_sections
from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import read_lines
from linework.model.grid import Bounds, holds
from linework.model.points import Points

PICTURES = Path(__file__).parents[1] / "pictures"
#: Colours of the palette: keeps the picture under 300 kB.
N_COLOURS = 128


def make_lines_picture(folder: Path) -> Image.Image:
    """Return plan, cuts across kerbs, markings and a rail, and a span, one below the other, of a finished demo."""
    lines, truth = read_lines(folder / "lines.gpkg"), read_lines(folder / "survey" / "truth.gpkg")
    points = read_survey_points(open_survey([folder / "survey"])).points

    def points_in(bounds: Bounds) -> Points:
        return points.take(holds(bounds, points.xyz))

    figures = [
        plan_figure(lines, points),
        kerb_figure(kerb_cuts(lines, points_in, truth)),
        marking_figure(marking_cuts(lines, points_in, truth)),
        rail_figure(rail_sections(points, lines, truth)),
    ]
    span = cable_section(points, lines, truth)
    if span is not None:
        figures.append(cable_figure(span))
    panels = [_pixels(figure) for figure in figures]
    return Image.fromarray(np.concatenate(panels)).quantize(
        N_COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
    )


def _pixels(figure: Figure) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(plot_png(figure))).convert("RGB"))


def run() -> int:
    """Run the demo in a folder of its own and write docs/pictures/lines.png."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "demo"
        code = main(["demo", str(folder)])
        if code:
            return code
        picture = make_lines_picture(folder)
    PICTURES.mkdir(exist_ok=True)
    picture.save(PICTURES / "lines.png", optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(run())
