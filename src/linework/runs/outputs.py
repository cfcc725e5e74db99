"""Publishing the result of a run: the lines, and their record beside them.

Separate from `extract`, which begins and resumes a run: this only writes its results.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from linework.crs import describe_crs
from linework.editing.queue.carried_over import carry_over_reviews
from linework.errors import LineworkError, OutputExistsError, argument
from linework.files.line_file.carried_history import added_by_others, has_reviews, with_history
from linework.files.line_file.file import LineFile
from linework.files.output.record import hash_file, json_bytes
from linework.files.store.facts import StoreFacts
from linework.files.vectors.read_write import not_expressed, points_left_out, write_lines
from linework.lines.lanes import find_lanes
from linework.model.lines import REJECTED_REVIEW, REVIEWS, LineSet
from linework.model.logs import VanLog
from linework.runs.extraction import Extraction, Failure, input_record, path_text
from linework.runs.record import record_path, versions
from linework.runs.steps import RunSteps
from linework.surface.aside import RoadAside


def publish_extraction(
    extraction: Extraction,
    output: Path,
    parameters: Mapping[str, Any],
    *,
    overwrite: bool = False,
    note: Callable[[str], None] | None = None,
    steps: RunSteps | None = None,
    reviews: KeptReviews | None = None,
    lanes: bool = False,
    location: str = "",
) -> dict[str, Any]:
    """Write the lines and run.json, and return the record.

    Parameters
    ----------
    parameters
        Of the request, with all settings, as they are written to the record.
    note
        Called with the SHA-256 of the lines' file before it gets its name.
    reviews
        Review decisions of the lines that are replaced (see `with_kept_reviews`).
    lanes, location
        Also write the lanes, as for `linework.files.vectors.read_write.write_lines`.

    Raises
    ------
    OutputExistsError, MachineError
        As for `linework.files.output.publish.publish`; the old lines and their record are then as before.

    Notes
    -----
    Every kind that was looked for has a layer, also without lines.
    """
    steps = steps or RunSteps()
    record: dict[str, Any] = {}

    def recorded(part: Path) -> bytes:
        record.update(record_of(extraction, output, parameters, steps, written=part, location=location))
        if reviews is not None:
            record["counts"]["reviews"] = dict(reviews.counts)
        if lanes:
            centre = find_lanes(extraction.lines).centre
            record["counts"] |= {
                "lanes": len(centre),
                "lane_length_m": round(float(centre.length_m.sum()), 3),
            }
        if note is not None:
            note(record["output"]["sha256"])
        return json_bytes(record)

    with steps.step("write lines"):
        write_lines(
            reviews.lines if reviews else extraction.lines, output,
            kinds=extraction.kinds, points=extraction.logged, overwrite=overwrite,
            beside={record_path(output): recorded}, finish=reviews.finish if reviews else None,
            lanes=lanes, location=location,
        )  # fmt: skip
    return record


def record_of(
    extraction: Extraction, output: Path, parameters: Mapping[str, Any], steps: RunSteps, *, written: Path,
    location: str = "",
) -> dict[str, Any]:  # fmt: skip
    """Return the record of a run.

    Parameters
    ----------
    written
        The finished file of lines, which will get the name `output`.
    location
        Of the lanes, as for `publish_extraction`.

    Raises
    ------
    RuntimeError
        The points in the files are not the sum of those used and those left out, or there are lines of kinds that
        were not looked for.
    """
    read, lines, pairs = extraction.read, extraction.lines, extraction.pairs
    n_lines = {kind: int((lines.kind == kind).sum()) for kind in extraction.kinds}
    if sum(n_lines.values()) != len(lines):
        raise RuntimeError(f"{len(lines)} lines, but {n_lines} of the kinds that were looked for")
    return {
        "command": "extract",
        "versions": versions(),
        "crs": {"name": describe_crs(lines.crs), "wkt": lines.crs},
        "parameters": dict(parameters),
        "inputs": [input_record(file, digest) for file, digest in extraction.hashes.items()],
        "output": {"file": path_text(output), "bytes": written.stat().st_size, "sha256": hash_file(written)},
        "counts": {
            **_point_counts(read),
            "tiles": len(extraction.tiles),
            "stereo_pairs": pairs.n_pairs if pairs else 0,
            "stereo_pairs_used": pairs.n_used if pairs else 0,
            **_logged_counts(extraction.logged),
            **_road_counts(extraction.aside),
            "lines": n_lines,
            "length_m": {
                kind: round(float(lines.length_m[lines.kind == kind].sum()), 3) for kind in extraction.kinds
            },
        },
        **({"turns": extraction.turns.as_document()} if extraction.turns else {}),
        **({"drives": extraction.drives.as_document()} if extraction.drives else {}),
        "timings_s": {step: round(seconds, 4) for step, seconds in steps.timings_so_far_s().items()},
        "tiles": [
            {
                "id": report.name,
                "core": list(report.tile.core),
                "buffer_m": report.tile.buffer_m,
                "points": report.n_points,
                "lines": report.n_lines,
                "problem": report.problem or None,
            }
            for report in extraction.tiles
        ],
        "warnings": [
            *extraction.warnings,
            *points_left_out(output, extraction.logged),
            *not_expressed(lines, output, location),
        ],
        "failures": [
            *(
                {"file": path_text(file), "problem": problem}
                for file, problem in (read.failures if read else ())
            ),
            *map(_failure_document, extraction.failures),
        ],
    }


def _failure_document(failure: Failure) -> dict[str, str | None]:
    """Return a failure for run.json: a tile's with its traceback or None, others with the traceback they have."""
    name = path_text(Path(failure.name)) if failure.what == "image" else failure.name
    found = {failure.what: name, "problem": failure.problem}
    if failure.trace or failure.what == "tile":
        return {**found, "trace": failure.trace or None}
    return dict(found)


def _logged_counts(logged: VanLog | None) -> dict[str, int]:
    """Return the number of images and of keys that have a position."""
    photos, events = (logged.photos, logged.events) if logged else (None, None)
    return {"photolog": len(photos) if photos else 0, "events": len(events) if events else 0}


def _road_counts(aside: RoadAside | None) -> dict[str, float]:
    """Return how much is road, and how much smooth ground within 15 m of it was not taken for road."""
    if aside is None:
        return {}
    return {
        "road_m2": round(aside.road_m2, 1),
        "not_road_m2": round(aside.aside_m2, 1),
        "not_road_m": round(aside.aside_m, 1),
        "not_road_share": round(aside.aside_points / max(aside.near_points, 1), 4),
    }


def _point_counts(read: StoreFacts | None) -> dict[str, Any]:
    """Return the numbers of points: those in the files are the sum of those used and those left out."""
    if read is None:
        return {"files": 0, "points_in_files": 0, "points_used": 0, "points_rejected": {}}
    n_promised = sum(facts.n_promised for facts in read.files)
    n_rejected = sum(read.rejected.values())
    if n_promised != read.n_points + n_rejected:
        raise RuntimeError(f"{n_promised} points, but {read.n_points} used and {n_rejected} left out")
    return {
        "files": len(read.files) + len(read.failures),
        "points_in_files": n_promised,
        "points_used": read.n_points,
        "points_rejected": dict(read.rejected),
    }


# Review decisions, carried over to the lines of a new extraction


@dataclass(frozen=True, slots=True)
class KeptReviews:
    """Reviewed lines of an earlier extraction that are written with the new ones.

    Parameters
    ----------
    lines
        All lines, rejected ones too.
    counts
        Lines that stay, by review decision, and `found_again`: new lines left out or cut because they are the same.
    finish
        Adds the history to the bytes of the file.
    """

    lines: LineSet
    counts: Mapping[str, int]
    finish: Callable[[bytes], bytes]


def refuse_to_lose(output: Path) -> None:
    """Refuse to replace a file of lines to which another program has added something.

    Raises
    ------
    OutputExistsError
        The message names what would be lost.
    """
    added = added_by_others(output) if output.suffix.lower() == ".gpkg" and output.is_file() else []
    if added:
        raise OutputExistsError(
            f"another program added {', '.join(added[:5])}{' and more' * (len(added) > 5)}, which would be lost",
            where=output,
            advice=f"copy that to another file, choose another name, or give {argument('forget_reviews', True)} to discard it",
        )


def with_kept_reviews(found: Extraction, output: Path) -> tuple[Extraction, KeptReviews | None]:
    """Return an extraction with the reviewed lines of `output`, which will be replaced.

    The lines of the extraction are then those that readers of the file will see. None: nothing was reviewed.

    Raises
    ------
    LineworkError
        The reviews cannot be used: they are in another CRS, or the file is damaged.
    """
    if output.suffix.lower() != ".gpkg" or not output.is_file() or not has_reviews(output):
        return found, None
    try:
        with LineFile.opened(output, crs=found.lines.crs, is_held=True) as drawing:
            there, judged = drawing.lines, drawing.judged
    except LineworkError as error:
        give = argument("forget_reviews", True)
        error.advice = f"give {give} to discard the reviews of its lines, or choose another name"
        raise
    kept = carry_over_reviews(found.lines, there, judged)
    lines = LineSet.concatenate([there.take(kept.stays), kept.new])
    n_reviewed = Counter(there.review[kept.stays].tolist())
    counts = {name: n_reviewed[name] for name in REVIEWS} | {"found_again": kept.n_again}
    visible = lines.take(lines.review != REJECTED_REVIEW)
    kinds = tuple(dict.fromkeys([*found.kinds, *sorted(set(visible.kind.tolist()))]))
    listed = ", ".join(f"{n} {name}" for name, n in counts.items() if n and name in REVIEWS) or "none"
    warning = f"{output}: kept the reviews of its lines ({listed}); {kept.n_again} lines found again were left out or cut"
    found = replace(found, lines=visible, kinds=kinds, warnings=(*found.warnings, warning))
    return found, KeptReviews(lines, counts, with_history(output, lines))
