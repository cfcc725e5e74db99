"""The scores of an evaluation as values: each with a name and a unit, None where undefined."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from linework.errors import UnknownKindError, printable


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStats:
    """Statistics of errors; all None where there are no errors.

    Parameters
    ----------
    n
        Number of errors.
    bias_m
        Mean of the signed errors; None for distances, which have no sign.
    rmse_m
        Root mean square.
    median_m, p95_m
        Median and 95th percentile of the absolute errors.
    """

    n: int = 0
    bias_m: float | None = None
    rmse_m: float | None = None
    median_m: float | None = None
    p95_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ToleranceScores:
    """The measures that depend on the tolerance b.

    E are the extracted lines, R the reference, |.| a length.

    Parameters
    ----------
    tolerance_m
        The tolerance b. ME is the part of E within b of R and of the same direction, MR the part of R within b of E.
    matched_extracted_m, matched_reference_m, matched_observed_m
        |ME|, |MR|, and |MR| over the observed reference.
    completeness, completeness_all
        |MR| / |R| over the observed reference, and over all of it.
    correctness
        |ME| / |E|, against all of the reference.
    quality, quality_all
        |ME| / (|E| + length of R outside MR), over the observed reference, and over all of it.
    redundancy
        (|ME| - |MR|) / |ME|, against all of the reference; slightly below 0 is possible at line ends.
    gaps_per_km
        Stretches of the observed reference without a match, per km of it.
    pieces_per_line
        Extracted lines per reference line, averaged over the reference lines found.
    n_missed, n_missed_observed
        Stations whose perpendicular meets no line within b; those of them on the observed reference.
    lateral, height
        Errors at the stations that meet a line; the RMSE cannot exceed b (in height only for cables).
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
    """A third of the stations ordered by sigma, with the ratio of their errors to sigma.

    Parameters
    ----------
    n, sigma_low_m, sigma_high_m
        Number of stations, and their range of sigma.
    rms_ratio
        rms(error / sigma): 1 is honest, above 1 is overconfident.
    """

    n: int
    sigma_low_m: float
    sigma_high_m: float
    rms_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceClass:
    """Pieces of similar confidence: their stated confidence and the share that is correct.

    Parameters
    ----------
    n
        Number of pieces.
    said, was
        Mean confidence, and share of correct pieces. The names are those of the JSON output.
    """

    n: int
    said: float
    was: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """How well confidence predicts correctness, judged per piece of about 10 m.

    Parameters
    ----------
    n_pieces, n_correct
        Number of pieces; those of them with more than half their length within the tolerance.
    calibration_error
        Mean difference of confidence and share of correct pieces, over ten classes of confidence.
    auc
        Probability that a correct piece has a higher confidence than a wrong one; None unless there are both.
    classes
        The classes that hold pieces, lowest confidence first.
    """

    n_pieces: int = 0
    n_correct: int = 0
    calibration_error: float | None = None
    auc: float | None = None
    classes: tuple[ConfidenceClass, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelScores:
    """Correctness of a text attribute of lines: role, pattern, form, double.

    Parameters
    ----------
    compared_m
        Length of the found reference that has the attribute. [m]
    share_right
        Share of it where the extracted line has the same value; having none is wrong.
    mistaken_m
        Lengths of the rest by "reference > extracted", longest first. [m]
    """

    compared_m: float = 0.0
    share_right: float | None = None
    mistaken_m: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DashScores:
    """Scores of single dashes.

    Parameters
    ----------
    n_reference, n_found
        Dashes observed over at least half their length; those of them with an extracted partner, which covers
        half of them or more.
    n_extracted, n_right
        Extracted dashes; those of them with a partner in the reference, observed or not.
    share_found, share_right
        n_found / n_reference, n_right / n_extracted.
    end_limit_m
        Tolerance for the ends (the mean, where surveys differ). [m]
    share_ends_within
        Share of the observed ends of found dashes within that tolerance.
    ends
        Errors of these ends along the dash, positive where the extracted dash is too long.
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
    """Scores of bridged stretches, and of the hidden reference.

    Parameters
    ----------
    hidden_m, hidden_found_m
        Length of the reference that could not be observed; the part of it that was found nevertheless. [m]
    bridged_m
        Length of extracted lines without measurement. [m]
    share_right
        Share of that within the tolerance of the reference.
    lateral, lateral_measured
        Errors at stations that meet a bridged stretch, at any distance searched (an honest bridge may be off by
        more than the tolerance); and at those that meet a measured one within the tolerance.
    sigma_xy, sigma_z
        Thirds of sigma at the stations of `lateral`.
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
    """The measures of a group of lines of one kind: boundaries with a kerb, dashed markings.

    Parameters
    ----------
    value
        The attribute of the group; "" where neither the reference nor the line has one.
    n_reference, reference_m, observed_m, extracted_m
        Number of lines, and lengths [m]. Extracted length belongs to the group of the reference that it lies
        on; where it lies on none, to its own.
    at
        The measures at the requested tolerance.
    height
        Errors of height_m, which for kerbs is the step.
    bridged
        Its bridged stretches, and the errors of the measured ones.
    """

    value: str
    n_reference: int
    reference_m: float
    observed_m: float
    extracted_m: float
    at: ToleranceScores
    height: ErrorStats
    bridged: BridgedScores


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class KindScores:
    """All measures of one kind, or of all kinds together.

    Parameters
    ----------
    kind
        "overall" for all kinds together; there too, a line matches lines of its own kind only.
    n_extracted, n_reference
        Number of lines.
    extracted_m, reference_m, observed_m
        |E|, |R|, and |R| over the observed reference.
    bridged_m
        Length of E without measurement.
    n_stations, n_stations_observed
        Stations on the reference, every 0.5 m; those of them where it was observed.
    at
        The measures at the requested tolerance.
    curve
        The measures at the tolerances of the curve.
    hausdorff_m, hausdorff_p95_m
        Largest distance from E to R or from the observed R to E, and its 95th percentile (the larger of both
        sides); directions are ignored.
    chamfer_ap
        Average precision of whole lines by confidence, per threshold on the Chamfer distance [m], as in
        the benchmarks of HD maps; overall: the mean of the kinds.
    attributes
        Errors of height_m, width_m, clearance_m where both lines have them, weighted by length.
    sigma_xy, sigma_z
        Thirds of sigma where the extracted line was measured, smallest first; empty without sigmas.
    confidence
        See `Calibration`.
    bridged
        Bridged stretches, and the hidden reference.
    labels
        Correctness of the text attributes, by name (role, pattern, form, double); of one kind only.
    groups
        Boundaries by form and markings by pattern, each scored separately.
    dashes
        For the kind lane_marking_dash; None for others.
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

    def __repr__(self) -> str:
        from linework.evaluation.summary import figures_text

        return printable(f"KindScores of {self.kind}: {figures_text(self)}")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Scores:
    """The scores of an evaluation: per kind, and of all kinds together; ``scores["cable"]`` are those of a kind.

    Parameters
    ----------
    tolerance_m
        Tolerance b of the main figures.
    kinds
        One entry per kind scored, in the order of the layers.
    overall
        All kinds together.
    """

    tolerance_m: float
    kinds: tuple[KindScores, ...]
    overall: KindScores

    def __getitem__(self, kind: str) -> KindScores:
        """Return the scores of one kind.

        Raises
        ------
        UnknownKindError
            It was not scored; it is a `KeyError`.
        """
        scored = {scores.kind: scores for scores in self.kinds}
        if kind not in scored:
            raise UnknownKindError(kind, tuple(scored), tuple(scored))
        return scored[kind]

    @property
    def missed(self) -> tuple[str, ...]:
        """Kinds of the truth of which there is no line among those found."""
        return tuple(scores.kind for scores in self.kinds if scores.n_reference and not scores.n_extracted)

    @property
    def unexpected(self) -> tuple[str, ...]:
        """Kinds of the lines found of which the truth has none."""
        return tuple(scores.kind for scores in self.kinds if scores.n_extracted and not scores.n_reference)

    def __repr__(self) -> str:
        from linework.evaluation.summary import text_of_scores

        return printable(text_of_scores(self), keep="\n")

    def to_frame(self, *, curve: bool = False) -> Any:
        """Return the main figures as a `pandas.DataFrame`, a row per kind and "overall" last.

        Parameters
        ----------
        curve
            Also the figures at the further tolerances: a row per kind and tolerance.

        Returns
        -------
        pandas.DataFrame
            Indexed by kind (and tolerance_m); lengths and errors in metres, shares from 0 to 1, NaN where undefined.

        Raises
        ------
        MissingPackageError
            pandas is not installed.
        """
        from linework.evaluation.summary import frame_of_scores

        return frame_of_scores(self, curve=curve)

    def to_dict(self) -> dict[str, Any]:
        """Return the scores as plain values for JSON; thresholds become texts, undefined figures None."""
        values = dataclasses.asdict(self)
        for scores in [*values["kinds"], values["overall"]]:
            scores["chamfer_ap"] = {f"{limit:g}": ap for limit, ap in scores["chamfer_ap"].items()}
        return values
