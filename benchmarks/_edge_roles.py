"""Roles of the edges beside boundaries, and forms of boundaries, against the truth of simulated scenes."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._failures import DENSE_M, EVERY_M, OFF_M, places_of
from linework.evaluation.report.tables import ReportTable, number, percent
from linework.model.lines import LineSet

NOTHING = "on no such edge"


def role_lengths(found: LineSet, truth: LineSet, column: str) -> Counter[tuple[str, str]]:
    """Metres of lines by true and found role (or form): the nearest true line within `OFF_M` of each half metre."""
    metres: Counter[tuple[str, str]] = Counter()
    there = sorted(set(getattr(truth, column).tolist()))
    trees = {
        name: cKDTree(places_of(truth.take(getattr(truth, column) == name), DENSE_M).xyz[:, :2])
        for name in there
    }
    for name in sorted(set(getattr(found, column).tolist())):
        places = places_of(found.take(getattr(found, column) == name), EVERY_M).xyz[:, :2]
        away = np.array([trees[other].query(places)[0] for other in there]).reshape(len(there), len(places))
        best = np.argmin(away, axis=0) if there else np.zeros(0, dtype=np.int64)
        for i in range(len(places)):
            is_near = bool(there) and away[best[i], i] <= OFF_M
            metres[there[best[i]] if is_near else NOTHING, name] += EVERY_M
    return metres


def roles_table(title: str, scenes: Sequence[tuple[str, Counter[tuple[str, str]]]]) -> ReportTable:
    """One row per scene and true role: metres, the share that has it, and what the others have."""
    rows = []
    for scene, metres in scenes:
        by_true: dict[str, Counter[str]] = defaultdict(Counter)
        for (true, name), length_m in metres.items():
            by_true[true][name] += length_m
        first = scene
        for true, names in sorted(by_true.items(), key=lambda item: (item[0] == NOTHING, item[0])):
            whole, right = sum(names.values()), names.get(true, 0.0)
            others = ", ".join(f"{n} {m:.0f} m" for n, m in names.most_common() if n != true)
            share = "" if true == NOTHING else percent(right / whole)
            rows.append((first, true, number(whole, 0), share, others))
            first = ""
        known = [(pair, m) for pair, m in metres.items() if pair[0] != NOTHING]
        if known:
            right = sum(m for (true, name), m in known if true == name)
            whole = sum(m for _, m in known)
            rows.append(("", "all", number(whole, 0), percent(right / whole), ""))
    return ReportTable(title, ("scene", "truth", "found\nm", "right", "others"), tuple(rows), "within 0.3 m")
