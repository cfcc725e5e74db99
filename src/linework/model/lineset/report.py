"""Report: what an extraction looked at, what it left out, and how long it took.

Separate from `linework.model.lines`, whose field it is: it is read, not computed with.
"""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from linework.errors import printable

#: Longest line of `repr` [characters], and entries of a list that are named.
_WIDTH, _NAMED = 110, 3


class InputReport(NamedTuple):
    """A file or recording that was looked at.

    Parameters
    ----------
    name
        Of the file or recording.
    n_used
        Points (or stereo pairs) used.
    n_left_out
        Points (or pairs) left out, by reason.
    """

    name: str
    n_used: int
    n_left_out: Mapping[str, int]


class LeftOut(NamedTuple):
    """Something that was left out: "file", "tile", "image" or "recording", its name, and why."""

    what: str
    name: str
    problem: str


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Report:
    """What an extraction looked at, what it left out, and how long it took.

    Parameters
    ----------
    source
        Name of the survey.
    kinds
        Kinds of line that were looked for.
    n_lines, length_m
        Number of lines and their length [m] by kind.
    inputs
        Files and recordings, with the points or pairs of each.
    left_out
        What could not be used, and why.
    warnings
        One line each.
    adjusted
        How several drives were made to agree, in one line; "" if there was nothing to adjust.
    timings_s
        Duration of each stage [s], in order.
    versions
        Versions of linework and of the packages that the lines depend on.

    Examples
    --------
    >>> Report(source="A7", kinds=("guardrail", "cable"), n_lines={"guardrail": 2}, length_m={"guardrail": 130.0},
    ...        inputs=(InputReport("a.laz", 4000, {"no time": 3}),), timings_s={"read": 0.5, "find": 2.0})
    Report on A7: 2 lines, 130.0 m
      guardrail 2 (130.0 m)
      looked for: guardrail, cable
      inputs: 1 (4,000 points or pairs used); left out: no time 3
      left out: nothing
      warnings: none
      time: 2.5 s (find 2.0, read 0.5)
    """

    source: str
    kinds: tuple[str, ...]
    n_lines: Mapping[str, int] = field(default_factory=dict)
    length_m: Mapping[str, float] = field(default_factory=dict)
    inputs: tuple[InputReport, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    warnings: tuple[str, ...] = ()
    adjusted: str = ""
    timings_s: Mapping[str, float] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def n_left_out(self) -> dict[str, int]:
        """Points and pairs of all inputs that were left out, by reason."""
        total: dict[str, int] = {}
        for one in self.inputs:
            for reason, n in one.n_left_out.items():
                total[reason] = total.get(reason, 0) + n
        return total

    def __repr__(self) -> str:
        return "\n".join(_shortened(text) for text in self._texts())

    def _texts(self) -> list[str]:
        """Return the lines of `repr`, at most ten."""
        n, size_m = sum(self.n_lines.values()), sum(self.length_m.values())
        texts = [f"Report on {self.source}: {n:,} line{'' if n == 1 else 's'}, {size_m:,.1f} m"]
        found = [f"{kind} {n:,} ({self.length_m.get(kind, 0.0):,.1f} m)" for kind, n in self.n_lines.items()]
        if found:
            texts.append("  " + ", ".join(found))
        texts.append(f"  looked for: {', '.join(self.kinds) or 'nothing'}")
        if self.inputs:
            used = sum(one.n_used for one in self.inputs)
            reasons = [f"{reason} {n:,}" for reason, n in self.n_left_out.items() if n]
            texts.append(
                f"  inputs: {len(self.inputs):,} ({used:,} points or pairs used)"
                + (f"; left out: {', '.join(reasons)}" if reasons else "")
            )
        names = [f"{one.what} {one.name} ({one.problem})" for one in self.left_out]
        texts.append(f"  left out: {_listed(names) or 'nothing'}")
        if self.adjusted:
            texts.append(f"  {self.adjusted}")
        texts.append(f"  warnings: {_listed(self.warnings) or 'none'}")
        if self.timings_s:
            longest = sorted(self.timings_s.items(), key=lambda item: -item[1])
            stages = ", ".join(f"{stage} {seconds:.1f}" for stage, seconds in longest[: 2 * _NAMED])
            texts.append(f"  time: {sum(self.timings_s.values()):.1f} s ({stages})")
        if self.versions:
            texts.append("  versions: " + ", ".join(f"{name} {text}" for name, text in self.versions.items()))
        return texts

    def _repr_html_(self) -> str:
        first, *others = (html.escape(text.strip()) for text in self._texts())
        items = "".join(f"<li>{text}</li>" for text in others)
        details = [f"<li>{html.escape(' '.join(one))}</li>" for one in self.left_out]
        details += [f"<li>{html.escape(text)}</li>" for text in self.warnings]
        folded = (
            f"<details><summary>all that was left out, and all warnings</summary><ul>{''.join(details)}</ul></details>"
            if details
            else ""
        )
        return f"<div><b>{first}</b><ul>{items}</ul>{folded}</div>"


def _listed(texts: tuple[str, ...] | list[str]) -> str:
    """Return the first of several texts and the number of the others, or "" for none."""
    more = len(texts) - _NAMED
    return "; ".join(texts[:_NAMED]) + (f"; and {more} more" if more > 0 else "")


def _shortened(text: str) -> str:
    """Return a text on one line that fits a console."""
    text = printable(text.rstrip().replace("\n", " "))
    return text if len(text) <= _WIDTH else text[: _WIDTH - 3] + "..."
