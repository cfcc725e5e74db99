"""What people said of lines, carried over into the lines of a new extraction."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from linework.errors import LineworkError
from linework.files.drawing import DrawingFile
from linework.files.drawing_carried import has_reviews, with_history
from linework.lines.reviewed import REJECTED, carried
from linework.model.lines import REVIEWS, LineSet
from linework.tiling.extraction import Extraction


@dataclass(frozen=True, slots=True)
class KeptReviews:
    """What is written besides what was found.

    Parameters
    ----------
    lines
        All lines, rejected ones too.
    counts
        Lines that stay, by what people said of them, and `found_again`: found lines left out or cut for them.
    finish
        Adds the history to the bytes of the file.
    """

    lines: LineSet
    counts: Mapping[str, int]
    finish: Callable[[bytes], bytes]


def with_kept_reviews(found: Extraction, output: Path) -> tuple[Extraction, KeptReviews | None]:
    """Return what was found beside what people said of the lines in `output`, which will be replaced.

    The lines of the extraction are then those that readers will see. None where nobody said anything.

    Raises
    ------
    LineworkError
        There are reviews that cannot be used: in another CRS, damaged.
    """
    if output.suffix.lower() != ".gpkg" or not output.is_file() or not has_reviews(output):
        return found, None
    try:
        with DrawingFile.opened(output, crs=found.lines.crs, is_held=True) as drawing:
            there, judged = drawing.lines, drawing.judged
    except LineworkError as error:
        error.advice = "give --forget-reviews to lose what people said of its lines, or choose another name"
        raise
    kept = carried(found.lines, there, judged)
    lines = LineSet.concatenate([there.take(kept.stays), kept.new])
    said = Counter(there.review[kept.stays].tolist())
    counts = {name: said[name] for name in REVIEWS} | {"found_again": kept.n_again}
    seen = lines.take(lines.review != REJECTED)
    kinds = tuple(dict.fromkeys([*found.kinds, *sorted(set(seen.kind.tolist()))]))
    told = ", ".join(f"{n} {name}" for name, n in counts.items() if n and name in REVIEWS) or "none"
    warning = f"{output}: kept what people said of its lines ({told}); {kept.n_again} found again were left out or cut"
    found = replace(found, lines=seen, kinds=kinds, warnings=(*found.warnings, warning))
    return found, KeptReviews(lines, counts, with_history(output, lines))
