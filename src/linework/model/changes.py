"""Changes of a line file: the lines that were removed, and those that replaced them."""

from __future__ import annotations

from dataclasses import dataclass

from linework.model.lines import LineSet


@dataclass(frozen=True, slots=True)
class Change:
    """A change of lines: some are removed, others added. Every edit of a person has this form.

    Parameters
    ----------
    action
        What was done, in one word: "accept", "split", "move" ...
    before
        Lines that are removed, as they are now.
    after
        Lines that are added: with the same `id` where they continue a line of `before`. Lines without an `id` get
        one when they are saved.
    """

    action: str
    before: LineSet
    after: LineSet

    @property
    def undone(self) -> Change:
        """The reverse change."""
        return Change("undo", self.after, self.before)


@dataclass(frozen=True, slots=True)
class Edit:
    """A change that was saved.

    Parameters
    ----------
    number
        From 1, in the order of saving; also the revision of the line file after it.
    time_utc
        Time of saving, ISO 8601.
    who
        Name of the person; "" for an extraction or another program.
    undoes
        Number of the edit that it undoes, 0: none.
    """

    number: int
    time_utc: str
    who: str
    change: Change
    undoes: int = 0
