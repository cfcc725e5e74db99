"""A simulated survey with exact truth in one call, for trials and for measuring accuracy."""

from __future__ import annotations

import inspect
import os
from dataclasses import dataclass
from pathlib import Path

from linework.errors import UsageError, argument, check_extra, did_you_mean
from linework.files.output.locks import reserve_folder
from linework.files.survey.open import open_survey
from linework.library.progress import Progress, display_of
from linework.model.survey import Survey
from linework.runs.steps import RunSteps
from linework.simulation.folder import write_survey_folder
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.cameras import stereo_survey
from linework.simulation.sensors.rigs import equipped
from linework.simulation.simulate import SimulatedSurvey, survey_of


@dataclass(frozen=True, slots=True)
class RecordedLike:
    """How the survey of a paper was recorded, as arguments of `simulate`."""

    road: str
    scanner: str
    points_per_m: float
    image_size: str
    image_every_m: float
    front_wheels: bool = False


#: Surveys after the published papers. Radon: one scanner, lines about 20 cm apart, which the paper's cells are taken
#: from; 480 points a line are a scanner of its day. Boxes: dense points of a van of today, kerbs and markings. Stereo:
#: images of 732 x 484 pixels, as published; 5 pairs a second at 72 km/h; the front wheels are counted.
LIKE = {
    "radon-2002": RecordedLike("motorway", "one", 2400.0, "732x484", 4.0),
    "obb-2023": RecordedLike("urban", "default", 10_000.0, "732x484", 4.0),
    "stereo-1992": RecordedLike("straight", "default", 1000.0, "732x484", 4.0, front_wheels=True),
}


def recorded_like(paper: str) -> RecordedLike:
    """Return how the survey of a paper was recorded.

    Raises
    ------
    UsageError
        No such paper; the nearest is named.
    """
    if paper not in LIKE:
        raise UsageError(
            f"unknown paper {paper!r}" + did_you_mean([str(paper)], LIKE), where=argument("like"),
            advice=f"choose from {', '.join(LIKE)}",
        )  # fmt: skip
    return LIKE[paper]


def simulate(
    folder: str | os.PathLike[str],
    *,
    road: str = "straight",
    seed: int = 0,
    length_m: float = 200.0,
    points_per_m: float | None = None,
    scanner: str = "default",
    conditions: str = "usual",
    holes: bool = False,
    front_wheels: bool = False,
    images: bool = True,
    image_size: str = "1240x376",
    image_every_m: float = 3.0,
    like: str = "",
    overwrite: bool = False,
    progress: Progress = None,
) -> Survey:
    """Return a simulated survey, written to a folder and opened.

    The folder holds points (LAZ), trajectory, navigation logs and stereo images, and beside them the exact lines:
    ``survey.root / "truth.gpkg"`` is the reference to evaluate against. The same arguments give byte-identical files.

    Parameters
    ----------
    folder
        New or empty; with `overwrite`, files of the same names are replaced.
    road
        Kind of road: "straight", "bends", "urban", "motorway", "rural", "junction", "gore",
        "roundabout" (at most 250 m), "village", "repainted", "lookalikes", "overpass", "tunnel", or "mixed", any of them;
        "forest", "field" and "roofs" are land without a road.
    seed
        Determines everything that no other argument sets.
    length_m
        Length of the drive, 40 to 5000. [m]
    points_per_m
        Approximate number of points per metre of drive; None: drawn from the seed.
    scanner
        What measures the road: "default" (one or two profile scanners on a van), "one", "tilted" (profile scanners whose
        planes lean and cross by any angles), or "spinning16", "spinning32", "spinning64", "spinning128" (a lidar of that
        many beams on a car), "airborne" (two overlapping flight strips) or "terrestrial" (two or three stations on
        tripods); the last two have neither trajectory nor logs nor images. With another than the default, the points
        have the fields of a scanner's files; `open_survey` says how to read them.
    conditions
        "hard": two passes in 3 of 4 surveys, calibration and navigation errors of up to 30 mm between them, range noise
        to 40 mm, intensities with offset, saturation and gain steps, mirrored points and rain.
    holes
        True: stretches of 10 to 60 m have no points, which cut the road in pieces as long as these.
    front_wheels
        True: the two front wheels are counted, not the rear ones.
    images
        False: no stereo images, which take minutes.
    image_size
        "732x484" (van roof) or "1240x376" (car).
    image_every_m
        Approximate distance between stereo pairs. [m]
    like
        "radon-2002", "obb-2023" or "stereo-1992": road, scanner, density and images as in that paper (`LIKE`), where
        the other arguments have their defaults.
    overwrite
        Replace what is in the folder.
    progress
        True: show progress on stderr. A function is called with (stage, done, total).

    Raises
    ------
    UsageError
        An unknown road, scanner, kind of conditions or image size (the nearest is named), or a number out of its range.
    OutputExistsError
        The folder is not empty, and `overwrite` is not set.

    Examples
    --------
    >>> import tempfile, linework
    >>> folder = tempfile.mkdtemp()
    >>> survey = linework.simulate(folder, road="bends", length_m=40.0, points_per_m=100, images=False)
    >>> survey.name, (survey.root / "truth.gpkg").is_file()
    ('simulated bends 0', True)
    """
    # The display stays for the whole call: what was simulated is read again at its end
    with display_of(progress) as display:
        simulate_to(
            Path(folder), RunSteps(display), road=road, seed=seed, length_m=length_m, points_per_m=points_per_m,
            scanner=scanner, conditions=conditions, holes=holes, front_wheels=front_wheels,
            images=images, image_size=image_size, image_every_m=image_every_m, like=like, overwrite=overwrite,
        )  # fmt: skip
        return open_survey(folder)


def simulate_to(
    folder: Path,
    steps: RunSteps,
    *,
    road: str,
    seed: int,
    length_m: float,
    points_per_m: float | None,
    scanner: str,
    conditions: str,
    holes: bool,
    front_wheels: bool,
    images: bool,
    image_size: str,
    image_every_m: float,
    like: str,
    overwrite: bool,
) -> tuple[SimulatedSurvey, int]:
    """Write a simulated survey as `simulate` does; return it and its number of stereo pairs."""
    check_extra("simulate")
    if like:
        paper = recorded_like(like)
        usual = inspect.signature(simulate).parameters
        road = paper.road if road == usual["road"].default else road
        scanner = paper.scanner if scanner == usual["scanner"].default else scanner
        front_wheels = front_wheels or paper.front_wheels
        points_per_m = paper.points_per_m if points_per_m is None else points_per_m
        image_size = paper.image_size if image_size == usual["image_size"].default else image_size
        image_every_m = (
            paper.image_every_m if image_every_m == usual["image_every_m"].default else image_every_m
        )
    with reserve_folder(folder, overwrite=overwrite):
        scenario = draw_scenario(road, seed, length_m, points_per_m=points_per_m)
        scenario = equipped(
            scenario, scanner=scanner, points_per_m=points_per_m, conditions=conditions, holes=holes
        )
        cameras = None
        if images and scenario.is_driven:
            cameras = stereo_survey(scenario, size=image_size, every_m=image_every_m)
        with steps.step("simulate scans"):
            survey = survey_of(scenario)
        with steps.step(
            "render images" if cameras else "write the survey", unit="pairs" if cameras else ""
        ) as advance:
            write_survey_folder(
                survey,
                folder,
                overwrite=overwrite,
                cameras=cameras,
                counts_front=front_wheels,
                advance=advance,
            )
    return survey, len(cameras) if cameras else 0
