"""How often the lines that are listed after a correction have the fault that was corrected, and how many of those there are.

Surveys are simulated and extracted as in `benchmarks.review`: few points, half of all paint gone. A line has a fault where
less than half of its length is right: false where nothing of any kind is there, of another kind where 80 % of it lies on
that. Each such line is corrected in turn, as a person would (rejected, or given its kind), and the lines that are then
listed are held against the truth: right where they have the same fault. Lines that are very much alike count by themselves,
too. The share of all other lines of the kind that have the fault says what a list drawn at random would do.

``python -m benchmarks.alike --roads urban,rural --seeds 4201-4203``; looked at while building: seeds 4101 and 4102.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks._review_scene import KINDS, POINTS_PER_M, WEAR, matched, scene_of, truth_of
from benchmarks.accuracy import seeds_of
from linework.editing.queue.alike import VERY_LIKE_CHANCE, line_measures, lines_alike
from linework.files.vectors.read_write import read_lines
from linework.workbench.review.point_measures import PointsOfLines
from linework.workbench.review.suspects import driven_path
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

#: Simulates and extracts: run where it is asked for.
ON_REQUEST = True


def main(arguments=()):
    options = parsed(arguments)
    every = []
    with tempfile.TemporaryDirectory(prefix="linework-alike-") as scratch:
        folder = Path(options.keep or scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for road in options.roads.split(","):
            rows = [
                row
                for seed in seeds_of(options.seeds)
                for row in taught(scene_of(road, seed, folder, options))
            ]
            said(road, rows)
            every += rows
    said("all", every)


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.alike")
    parser.add_argument("--roads", default="urban,rural,junction,motorway", help="with commas between")
    parser.add_argument("--seeds", default="4201-4203", help="first-last, or a list")
    parser.add_argument("--length-m", type=float, default=300.0)
    parser.add_argument("--points-per-m", type=float, default=POINTS_PER_M)
    parser.add_argument("--wear", type=float, default=WEAR, help="share of the paint that is gone, at least")
    parser.add_argument("--keep", default="", help="folder for surveys and lines")
    return parser.parse_args(list(arguments))


def taught(scene):
    """A row per faulty line: kind, lines listed, of them right; very alike ones, of them right; others with the fault; others."""
    truth, lines = truth_of(scene), read_lines(scene.lines)
    # Of edges beside a boundary the truth knows nothing
    lines = lines.take(np.isin(lines.kind, KINDS) & (lines.kind != "edge_other"))
    faults = faults_of(lines, truth)
    session = SurveySession(SurveyOrder((scene.survey,), work=scene.work), lambda _: None)
    rows = []
    for kind in sorted(set(lines.kind[faults != ""].tolist())):
        chosen = np.flatnonzero(lines.kind == kind)
        points = PointsOfLines().of(session, lines.take(chosen))
        measures = line_measures(lines, chosen, driven_path(session)) | points
        own, nobody = faults[chosen], np.zeros(len(chosen), dtype=bool)
        for i in np.flatnonzero(own != "").tolist():
            example = np.arange(len(chosen)) == i
            same = (own == own[i]) & ~example
            found = lines_alike(example, nobody, ~example, measures)
            hits = [bool(same[one.line]) for one in found]
            very = [hit for one, hit in zip(found, hits, strict=True) if one.chance <= VERY_LIKE_CHANCE]
            row = (len(hits), sum(hits), len(very), sum(very), int(same.sum()), len(chosen) - 1)
            rows.append((kind, *row))
    return rows


def faults_of(lines, truth):
    """What is wrong with each line: "", "false", or the kind that it should have."""
    share = np.ones(len(lines))
    for kind in set(lines.kind.tolist()):
        share[lines.kind == kind] = right_shares(lines[kind], truth, kind)
    faults = np.where(share < 0.5, "false", "").astype(object)
    for kind in sorted(set(truth.kind.tolist())):
        bad = np.flatnonzero((faults == "false") & (lines.kind != kind))
        if len(bad):
            as_kind = lines.take(bad).with_columns(kind=np.full(len(bad), kind))
            faults[bad[right_shares(as_kind, truth, kind) >= 0.8]] = kind
    return faults


def right_shares(lines, truth, kind):
    """Share of the length of each line, all of one kind, that is right."""
    match, is_right, _ = matched(lines.with_columns(crs=truth.crs), truth, kind)
    pieces, n = match.e_pieces, len(lines)
    right, whole = (
        np.bincount(pieces.line, length, n) for length in (pieces.length_m * is_right, pieces.length_m)
    )
    return right / np.maximum(whole, 1e-9)


def said(name, rows):
    figures = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 6)
    listed, right, very, very_right, faulty, others = figures.sum(axis=0)
    print(
        f"{name}: {len(rows)} corrections, the same fault in {percent(faulty, others)} of the other lines of the kind\n"
        f"  listed {listed:.0f}, right {right:.0f} ({percent(right, listed)}), {percent(right, faulty)} of the faulty\n"
        f"  very alike {very:.0f}, right {very_right:.0f} ({percent(very_right, very)}),"
        f" {percent(very_right, faulty)} of the faulty",
        flush=True,
    )
    for kind in sorted({row[0] for row in rows}):
        some = np.array([row[1:] for row in rows if row[0] == kind], dtype=float).sum(axis=0)
        listed, right, very, very_right, faulty, _ = some.tolist()
        print(
            f"    {kind}: right {right:.0f} of {listed:.0f} listed, {very_right:.0f} of {very:.0f} very alike; {faulty:.0f} faulty"
        )


def percent(part, whole):
    return f"{100.0 * part / whole:.0f} %" if whole else "-"


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
