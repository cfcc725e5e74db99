"""`linework info`: a summary of a survey."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from linework.cli.failures import warn
from linework.cli.options import AllowOutside, AllowRemote, AsJson, Crs, Quiet, SurveyArgument, WorkFolder
from linework.cli.said import say, say_json


def info(
    surveys: SurveyArgument,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Summarise SURVEY: points, trajectory, images and logs.

    Lists files, CRS, extent, heights, point density, scan-line spacing, intensity, times and their gaps,
    trajectory, cameras, stereo pairs (and whether their rows match) and logs. Of points at an address only the headers
    are read.
    """
    from linework.files.remote.address import is_remote
    from linework.files.survey.open import open_survey
    from linework.library.progress import open_display
    from linework.processes.system import usable_cores
    from linework.runs.opened.describe import describe_survey
    from linework.runs.opened.points import opened_survey
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.steps import RunSteps

    with open_display(quiet=quiet) as display:
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        is_here = not any(is_remote(path) for path in survey.point_files)
        if survey.point_files and is_here:
            folder = work_folder(survey.root, work)
            with opened_survey(survey, folder, n_threads=usable_cores(), steps=RunSteps(display)) as opened:
                document = describe_survey(opened, survey)
        else:
            document = describe_survey(None, survey)
    if as_json:
        say_json(document)
    else:
        for line in _lines(document):
            say(line)
        for warning in document["warnings"]:
            warn(warning)
    _report_left_out(document)


def _lines(document: dict[str, Any]) -> Iterator[str]:
    """Yield the document as lines of text."""
    yield f"survey      {document['name']}"
    height = "heights in its vertical datum" if document["crs"]["compound"] else "no vertical datum"
    yield f"CRS         {document['crs']['name']}, {height}"
    for file in document["files"]:
        left_out = ", ".join(f"{n:,} {reason}" for reason, n in file["rejected"].items())
        kind = f"LAS {file['version']}, point format {file['point_format']}"
        if not file["version"]:
            kind = Path(file["file"]).suffix[1:].upper()
        yield (
            f"file        {file['file']}: {kind}, {file['points']:,} points"
            + (f", left out: {left_out}" if left_out else "")
        )
    if document["points"]:
        yield from _points(document)
    yield from _recorded(document)
    yield from _driven(document)


def _points(document: dict[str, Any]) -> Iterator[str]:
    """Yield the lines about the positions of the points."""
    extent = document["extent_m"]
    by_headers = document["height_m"] is None
    yield f"points      {document['points']:,}" + (" by the headers; no point was read" if by_headers else "")
    if extent is not None:
        yield (
            f"extent      east {extent['west']:.2f} to {extent['east']:.2f}, north {extent['south']:.2f} to "
            f"{extent['north']:.2f} ({extent['east'] - extent['west']:.1f} x {extent['north'] - extent['south']:.1f} m)"
        )
    if by_headers:
        return
    yield f"height      {_spread(document['height_m'])} m"
    yield f"density     {_spread(document['density_per_m2'])} points/m2"
    if document["scan_line_spacing_m"] is not None:
        yield f"scan lines  {document['scan_line_spacing_m']:.3f} m apart along the road"


def _recorded(document: dict[str, Any]) -> Iterator[str]:
    """Yield the lines about the intensities, times and further columns of the points."""
    intensity, time = document["intensity"], document["time"]
    if not document["points"]:
        yield "points      none"
        return
    if document["height_m"] is not None:
        yield from _intensity_and_time(intensity, time)
    # In the order of the files, each once
    columns = dict.fromkeys(name for file in document["files"] for name in file["columns"])
    yield f"columns     {', '.join(columns)}"


def _intensity_and_time(intensity: dict[str, Any] | None, time: dict[str, Any] | None) -> Iterator[str]:
    """Yield the lines about what is read with each point."""
    yield "intensity   " + (
        "none"
        if intensity is None
        else f"{intensity['lowest']:.0f} to {intensity['highest']:.0f}, median {intensity['median']:.0f}, "
        f"{intensity['bits']} bits"
    )
    if time is None:
        yield "time        none"
    else:
        order = "sorted" if time["in_order"] else "not sorted"
        yield (
            f"time        {time['start_s']:.3f} to {time['end_s']:.3f} s "
            f"({time['end_s'] - time['start_s']:.1f} s, GPS {time['kind']}, {order}), "
            f"{time['n_gaps']} gaps longer than {time['gap_longer_than_s']:g} s"
        )
        for gap in time["gaps"]:
            yield f"  gap       {gap['start_s']:.3f} to {gap['end_s']:.3f} s"


def _driven(document: dict[str, Any]) -> Iterator[str]:
    """Yield the lines about the trajectory, the cameras and the logs."""
    path, cameras = document["trajectory"], document["cameras"]
    if path is None:
        yield "trajectory  none"
    else:
        yield (
            f"trajectory  {path['length_m']:,.1f} m in {path['end_s'] - path['start_s']:.1f} s, mean "
            f"{path['mean_speed_mps'] * 3.6:.0f} km/h, {path['positions']:,} positions, "
            + ("with attitude" if path["has_attitude"] else "no attitude")
        )
    if cameras is not None:
        yield from _of_cameras(cameras)
    for name, camera in document["single_cameras"].items():
        rate = "" if camera["rate_hz"] is None else f", {camera['rate_hz']:g} Hz"
        yield (
            f"camera      {name}: {camera['images']:,} images for the photolog, {camera['start_s']:.3f} to "
            f"{camera['end_s']:.3f} s{rate}"
        )
    for name, log in document["logs"].items():
        span = f"{log['start_s']:.3f} to {log['end_s']:.3f} s" if log["rows"] else "no rows"
        rate = "" if name == "events" or log["rate_hz"] is None else f", {log['rate_hz']:g} Hz"
        shares = {kind: n / log["rows"] for kind, n in log.get("quality", {}).items()}
        kinds = "".join(f", {share:.0%} {kind}" for kind, share in shares.items())
        yield f"{name:<12}{log['file']}: {log['rows']:,} rows, {span}{rate}{kinds}"


def _of_cameras(cameras: dict[str, Any]) -> Iterator[str]:
    for side in ("left", "right"):
        camera = cameras[side]
        lens = "with distortion" if camera["is_distorted"] else "no distortion"
        yield (
            f"camera      {side}: {camera['width']} x {camera['height']} pixels, focal length "
            f"{camera['focal_px']:g} pixels, {lens}"
        )
    rate = "" if cameras["rate_hz"] is None else f", {cameras['rate_hz']:g} Hz"
    yield (
        f"pairs       {cameras['pairs']:,}, baseline {cameras['base_m']:.3f} m, {cameras['start_s']:.3f} to "
        f"{cameras['end_s']:.3f} s{rate}, {cameras['unpaired_images']:,} unpaired images"
    )
    if cameras["row_error_px"] is not None:
        yield f"rows        left and right rows differ by {cameras['row_error_px']:.2f} pixels (median)"


def _spread(values: dict[str, float]) -> str:
    return (
        f"{values['lowest']:,.2f} to {values['highest']:,.2f}, median {values['median']:,.2f}, "
        f"5th to 95th percentile {values['percentile_5']:,.2f} to {values['percentile_95']:,.2f}"
    )


def _report_left_out(document: dict[str, Any]) -> None:
    """Raise PartialError where files were left out."""
    from linework.errors import PartialError
    from linework.runs.record import MAX_LISTED

    failures = document["failures"]
    if failures:
        n_files = len(failures) + len(document["files"])
        of_files = all("file" in failure for failure in failures)
        parts = "part" if len(failures) == 1 else "parts"
        what = f"of {n_files} files left out" if of_files else f"{parts} of the survey cannot be used"
        listed = "; ".join(failure["problem"].rstrip(".") for failure in failures[:MAX_LISTED])
        more = f" and {len(failures) - MAX_LISTED} more" if len(failures) > MAX_LISTED else ""
        raise PartialError(
            f"{len(failures)} {what}: {listed}{more}", where=document["name"],
            advice="--json lists them all" if more else "",
        )  # fmt: skip
