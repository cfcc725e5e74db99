"""The values that scores are made of: each a named figure with its unit, undefined ones None."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStats:
    """Errors in figures; all None where there were none.

    Parameters
    ----------
    n
        How many.
    bias_m
        Mean of the signed errors; None for distances, which have no sign.
    rmse_m
        Root of the mean square.
    median_m, p95_m
        Half, and 95 % of the errors are no larger than this, signs left out.
    """

    n: int = 0
    bias_m: float | None = None
    rmse_m: float | None = None
    median_m: float | None = None
    p95_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ToleranceScores:
    """The measures that depend on the tolerance b.

    E is what was extracted, R the reference, |.| a length.

    Parameters
    ----------
    tolerance_m
        b. ME is the part of E within b of R and of the same direction, MR the part of R within b of E.
    matched_extracted_m, matched_reference_m, matched_observed_m
        |ME|, |MR| and |MR| where the reference was observed.
    completeness, completeness_all
        |MR| / |R| over the observed reference, and over all of it.
    correctness
        |ME| / |E|, against all of the reference.
    quality, quality_all
        |ME| / (|E| + length of R without MR), R over the observed reference, and over all of it.
    redundancy
        (|ME| - |MR|) / |ME|, against all of the reference; a hair below 0 is possible at line ends.
    gaps_per_km
        Stretches of the observed reference without a match, per km of it.
    pieces_per_line
        Extracted lines on a reference line, mean over the reference lines that were found.
    n_missed, n_missed_observed
        Stations whose perpendicular met nothing within b; those of them on the observed reference.
    lateral, height
        Errors at the stations that met something; the RMSE cannot exceed b (in height: only for cables).
    space
        Cables: distances in the vertical plane across the reference.
    """

    tolerance_m: float
    matched_extracted_m: float
    matched_reference_m: float
    matched_observed_m: float
    completeness: float | None
    completeness_all: float | None
    correctness: float | None
    quality: float | None
    quality_all: float | None
    redundancy: float | None
    gaps_per_km: float | None
    pieces_per_line: float | None
    n_missed: int
    n_missed_observed: int
    lateral: ErrorStats
    height: ErrorStats
    space: ErrorStats


@dataclass(frozen=True, slots=True, kw_only=True)
class SigmaTercile:
    """A third of the stations by sigma: were their errors as large as it says.

    Parameters
    ----------
    n, sigma_low_m, sigma_high_m
        How many stations, and their range of sigma.
    rms_ratio
        rms(error / sigma): 1 is honest, above 1 is too sure.
    """

    n: int
    sigma_low_m: float
    sigma_high_m: float
    rms_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceClass:
    """Pieces of about the same confidence: how sure they were said to be, and how often that was right.

    Parameters
    ----------
    n
        Pieces.
    said, was
        Their mean confidence; the share of them that is correct.
    """

    n: int
    said: float
    was: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Does the confidence say how often a line is right: judged per piece of about 10 m.

    Parameters
    ----------
    n_pieces, n_correct
        Pieces; those of them with more than half their length within tolerance.
    calibration_error
        Mean difference between confidence and the share that is correct, over ten classes of confidence.
    auc
        Chance that a correct piece has a higher confidence than a wrong one; None without both.
    classes
        The classes of confidence that hold pieces, least sure first.
    """

    n_pieces: int = 0
    n_correct: int = 0
    calibration_error: float | None = None
    auc: float | None = None
    classes: tuple[ConfidenceClass, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelScores:
    """Is a word that lines carry (role, pattern, form) the right one.

    Parameters
    ----------
    compared_m
        Length of the found reference that has such a word.
    share_right
        Part of it where the extracted line has the same word; having none is wrong.
    mistaken_m
        The rest by "reference > extracted", longest first. [m]
    """

    compared_m: float = 0.0
    share_right: float | None = None
    mistaken_m: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DashScores:
    """The dashes of markings, one by one.

    Parameters
    ----------
    n_reference, n_found
        Dashes seen over at least half their length; those of them that an extracted dash of their own covers
        by half or more.
    n_extracted, n_right
        Extracted dashes; those of them that lie on a dash of their own, seen or not.
    share_found, share_right
        n_found / n_reference, n_right / n_extracted.
    end_limit_m
        How far off an end may be (the mean, where surveys differ).
    share_ends_within
        Part of the seen ends of found dashes that is no further off than that.
    ends
        Errors of these ends along the line, positive where the extracted dash is too long.
    """

    n_reference: int
    n_found: int
    n_extracted: int
    n_right: int
    share_found: float | None
    share_right: float | None
    end_limit_m: float
    share_ends_within: float | None
    ends: ErrorStats


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgedScores:
    """What was carried over gaps, and what lies hidden.

    Parameters
    ----------
    hidden_m, hidden_found_m
        Length of the reference that could not be observed; the part of it that was found all the same.
    bridged_m
        Length of extracted lines without measurement.
    share_right
        The part of that within the tolerance of the reference.
    lateral, lateral_measured
        Errors at stations that met a bridged stretch, at any distance searched (a bridge may be wider off
        than the tolerance and still say so); and those within the tolerance that met a measured one.
    sigma_xy, sigma_z
        Terciles of sigma at the stations of `lateral`.
    """

    hidden_m: float
    hidden_found_m: float
    bridged_m: float
    share_right: float | None
    lateral: ErrorStats
    lateral_measured: ErrorStats
    sigma_xy: tuple[SigmaTercile, ...]
    sigma_z: tuple[SigmaTercile, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupScores:
    """The measures of the lines of one kind that share a word: boundaries with a kerb, dashed markings.

    Parameters
    ----------
    value
        The word; "" where neither the reference nor the line has one.
    n_reference, reference_m, observed_m, extracted_m
        Lines and lengths. Extracted length belongs to the word of the reference that it lies on; where it
        lies on none, to its own.
    at
        At the tolerance asked for.
    height
        Errors of height_m: of the step at the foot of a kerb.
    bridged
        What was bridged of it, and the errors of what was measured.
    """

    value: str
    n_reference: int
    reference_m: float
    observed_m: float
    extracted_m: float
    at: ToleranceScores
    height: ErrorStats
    bridged: BridgedScores


# What an evaluation says, kind by kind and overall


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
