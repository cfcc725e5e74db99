"""What an evaluation says, kind by kind and overall."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from linework.evaluation.values import (
    BridgedScores,
    Calibration,
    DashScores,
    ErrorStats,
    GroupScores,
    LabelScores,
    SigmaTercile,
    ToleranceScores,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class KindScores:
    """All measures of one kind, or of all kinds together.

    Parameters
    ----------
    kind
        "overall" for all kinds together; a line matches lines of its own kind only, there too.
    n_extracted, n_reference
        Lines.
    extracted_m, reference_m, observed_m
        |E|, |R|, and |R| where it was observed.
    bridged_m
        Length of E without measurement.
    n_stations, n_stations_observed
        Stations on the reference, every 0.5 m; those of them where it was observed.
    at
        At the tolerance asked for.
    curve
        At the tolerances of the curve.
    hausdorff_m, hausdorff_p95_m
        Largest distance from E to R or from the observed R to E, and its 95th percentile (the larger of the
        two sides'); directions left out.
    chamfer_ap
        Average precision of whole lines by confidence, per threshold on the Chamfer distance [m], as in
        the benchmarks of HD maps; overall: the mean of the kinds.
    attributes
        Errors of height_m, width_m, clearance_m where both lines have them, weighted by length.
    sigma_xy, sigma_z
        Terciles of sigma where the extracted line was measured, smallest first; empty without sigmas.
    confidence
        See `Calibration`.
    bridged
        Stretches that were carried over gaps, and those that were hidden.
    labels
        By name (role, pattern, form, double): was the right word said. Of one kind only.
    groups
        Boundaries by form and markings by pattern, each scored apart.
    dashes
        Of the kind lane_marking_dash; None for others.
    """

    kind: str
    n_extracted: int
    n_reference: int
    extracted_m: float
    reference_m: float
    observed_m: float
    bridged_m: float
    n_stations: int
    n_stations_observed: int
    at: ToleranceScores
    curve: tuple[ToleranceScores, ...]
    hausdorff_m: float | None
    hausdorff_p95_m: float | None
    chamfer_ap: dict[float, float | None]
    attributes: dict[str, ErrorStats]
    sigma_xy: tuple[SigmaTercile, ...]
    sigma_z: tuple[SigmaTercile, ...]
    confidence: Calibration
    bridged: BridgedScores
    labels: dict[str, LabelScores]
    groups: tuple[GroupScores, ...]
    dashes: DashScores | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """An evaluation: each kind, and all of them together.

    Parameters
    ----------
    tolerance_m
        b of the main figures.
    kinds
        One entry per kind that was scored, in the order of the layers.
    overall
        Lengths and stations of all kinds together.
    """

    tolerance_m: float
    kinds: tuple[KindScores, ...]
    overall: KindScores

    def of_kind(self, kind: str) -> KindScores:
        """Return the scores of one kind; KeyError where it was not scored."""
        for scores in self.kinds:
            if scores.kind == kind:
                return scores
        raise KeyError(kind)

    def to_dict(self) -> dict[str, Any]:
        """Return the scores as plain values for JSON; thresholds become text, what is undefined is None."""
        values = dataclasses.asdict(self)
        for scores in [*values["kinds"], values["overall"]]:
            scores["chamfer_ap"] = {f"{limit:g}": ap for limit, ap in scores["chamfer_ap"].items()}
        return values
