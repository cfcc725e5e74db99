"""Changes of a drawing: which lines were taken out, and which were put in their place."""

from __future__ import annotations

from dataclasses import dataclass

from linework.model.lines import LineSet


@dataclass(frozen=True, slots=True)
class Change:
    """Everything a person does to lines, whatever it is: some go, others come.

    Parameters
    ----------
    action
        What was done, in one word: "accept", "split", "move" ...
    before
        Lines as they are, which are taken out.
    after
        Lines that come in: of the same `id` where a line goes on, with a new one where it is new. Lines without an
        `id` are given one when they are saved.
    """

    action: str
    before: LineSet
    after: LineSet

    @property
    def undone(self) -> Change:
        """The change back."""
        return Change("undo", self.after, self.before)


@dataclass(frozen=True, slots=True)
class Edit:
    """A change that was saved.

    Parameters
    ----------
    number
        From 1, in the order of saving; also the revision of the drawing after it.
    time_utc
        When, as ISO 8601.
    who
        Who did it.
    change
        What was done.
    undoes
        Number of the edit that it takes back, 0: none.
    """

    number: int
    time_utc: str
    who: str
    change: Change
    undoes: int = 0
