"""The operator's keys as they are pressed: each on the disk before it is acknowledged, and each can be undone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from linework.errors import InputError
from linework.files.logs.tables import csv_line, finite_number, header_cells, split_cells
from linework.files.output.appended import AppendedFile
from linework.files.output.replace import replace_file

#: Columns of the file; `read_events` reads it as any log of keys.
EVENT_COLUMNS = ("time_s", "key", "span", "press", "note")
#: Values of `span`: of a point, and of the two presses that begin and end a stretch.
POINT, BEGIN, END = "", "begin", "end"


@dataclass(frozen=True, slots=True)
class Press:
    """One press of a key.

    Parameters
    ----------
    time_s
        On the survey's clock. [s]
    span
        One of ``POINT``, ``BEGIN``, ``END``.
    press
        Identity, given by the page: a press that is sent twice counts once.
    """

    time_s: float
    key: str
    span: str
    press: str
    note: str = ""

    def line(self) -> str:
        """Return the line of the file."""
        return csv_line([f"{self.time_s:.3f}", self.key, self.span, self.press, self.note])


class EventsFile:
    """The presses of a drive in a CSV file.

    Parameters
    ----------
    path
        Created with the first press; one of an earlier start is continued.

    Raises
    ------
    InputError
        It is there and holds other columns.
    MachineError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = AppendedFile(path)
        header, *rows = self._file.lines() or [",".join(EVENT_COLUMNS)]
        if header_cells(header)[1] != list(EVENT_COLUMNS):
            raise InputError(
                f"its columns are not {','.join(EVENT_COLUMNS)}: it was not written by linework live", where=path,
                advice="name another file with [events] file",
            )  # fmt: skip
        self._is_new = not self._file.lines()
        found = [_press_of(row) for row in rows]
        self.presses: list[Press] = [press for press in found if press is not None]

    def find(self, press: str) -> Press | None:
        """Return the press of an identity, or None."""
        return next((one for one in reversed(self.presses) if one.press == press), None)

    def open_spans(self) -> dict[str, Press]:
        """Return the press that began each stretch that has not ended, by its key."""
        found: dict[str, Press] = {}
        for press in self.presses:
            if press.span == BEGIN:
                found[press.key] = press
            elif press.span == END:
                found.pop(press.key, None)
        return found

    def add(self, press: Press) -> None:
        """Append a press; the disk holds it when this returns.

        Raises
        ------
        MachineError
            The disk is full: the press is not noted.
        """
        header = csv_line(EVENT_COLUMNS) if self._is_new else ""
        self._file.append(header + press.line())
        self._is_new = False
        self.presses.append(press)

    def remove(self, press: str) -> Press | None:
        """Remove a press, and return it; None where there is none of that identity.

        Raises
        ------
        MachineError
            The disk is full: the press stays.
        """
        found = self.find(press)
        if found is None:
            return None
        rest = [one for one in self.presses if one is not found]
        text = csv_line(EVENT_COLUMNS) + "".join(one.line() for one in rest)
        replace_file(self.path, text.encode("utf-8", errors="backslashreplace"))
        self._file = AppendedFile(self.path)
        self.presses = rest
        return found


def _press_of(row: str) -> Press | None:
    """Return the press of a line; None where it is not one."""
    cells = split_cells(row, ",")
    time = finite_number(cells[0]) if len(cells) == len(EVENT_COLUMNS) else None
    return None if time is None else Press(time, *cells[1:])
