"""Points moved by a millimetre at random: what of a result depends on that is luck, not skill."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from linework.evaluation.report.tables import ReportTable, number, percent
from linework.evaluation.values import KindScores
from linework.model.points import Points

#: Less than any scanner's noise. [m]
MOVED_M = 0.001


def moved(points: Points, seed: int) -> Points:
    """Return points moved by `MOVED_M` in each direction at random; as they are for seed 0."""
    if seed == 0:
        return points
    return replace(
        points, xyz=points.xyz + np.random.default_rng(seed).normal(0.0, MOVED_M, points.xyz.shape)
    )


class MovedRuns:
    """Metres of truth, found of it, and drawn and false in each run of a scene or survey, by kind."""

    def __init__(self) -> None:
        self._runs: dict[tuple[str, str], list[tuple[float, float, float, float]]] = defaultdict(list)

    def add(self, name: str, one: KindScores) -> None:
        """Enter one run of a scene or survey."""
        reference_m = one.observed_m or one.reference_m
        found_m = reference_m * (one.at.completeness or 0.0)
        false_m = one.extracted_m - one.at.matched_extracted_m
        self._runs[name, one.kind].append((reference_m, found_m, false_m, one.extracted_m))

    def pooled(self) -> ReportTable:
        """Return the scores of all runs of each scene or survey together, by kind."""
        rows = []
        for (name, kind), runs in self._runs.items():
            reference, found, false, drawn = np.sum(runs, axis=0).tolist()
            rows.append(
                (
                    name, kind, str(len(runs)), percent(found / reference if reference else None),
                    percent(1.0 - false / drawn if drawn else None),
                )
            )  # fmt: skip
        return ReportTable("All runs", ("name", "kind", "runs", "complete", "correct"), tuple(rows))

    def table(self) -> ReportTable:
        """Return by kind by how much found and false metres differ between the runs, the most less the least."""
        rows = []
        for kind in dict.fromkeys(kind for _, kind in self._runs):
            runs = [np.array(own)[:, :3] for (_, of), own in self._runs.items() if of == kind]
            reference, found, false = np.sum(
                [[np.max(r[:, 0]), *np.ptp(r[:, 1:], axis=0)] for r in runs], axis=0
            )
            rows.append((kind, number(reference, 0), number(found, 0), number(false, 0)))
        return ReportTable(
            "What depends on a millimetre",
            ("kind", "truth\nm", "found, most\nless least\nm", "false, most\nless least\nm"),
            tuple(rows),
            f"points moved by {1000.0 * MOVED_M:.0f} mm at random; summed over scenes and surveys",
        )
