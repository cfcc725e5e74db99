"""The operator's keys: a CSV of times, key presses and notes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.logs.tables import finite_number, read_text_table
from linework.model.survey import Survey

#: File of the operator's keys in a survey's folder, where [events] names no other.
EVENTS_NAME = "events.csv"
#: Longest note [characters]; longer ones are cut. A sentence typed while driving is shorter.
MAX_NOTE_CHARS = 1000


@dataclass(frozen=True, slots=True)
class EventRows:
    """Keys in time order, and warnings about the file; `span` as in `linework.model.logs.Events`."""

    time_s: FloatArray
    key: tuple[str, ...]
    note: tuple[str, ...]
    span: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def events_file(survey: Survey) -> Path | None:
    """Return the file of the operator's keys: that of [events], else what `linework live` has written; or None."""
    named = survey.settings.get("events", {}).get("file")
    if named is None and "live" in survey.settings and (survey.root / EVENTS_NAME).is_file():
        named = EVENTS_NAME
    return None if named is None else survey.root / str(named)


def read_events(path: Path) -> EventRows:
    """Read a CSV ``time_s,key,note``; the note may be missing, and may hold commas if it comes last.

    A column ``span`` may say which presses begin and end a stretch: "begin" and "end", "" for all others.

    Lines without a time or a key, which occur when typing while driving, are left out and counted.

    Raises
    ------
    InputError
        A column is missing, or no line has both a time and a key.
    """
    table = read_text_table(path, ("time_s", "key"), ("span", "note"), rest_in_last=True)
    times = [finite_number(text) for text in table.columns["time_s"]]
    keys = table.columns["key"]
    notes, spans = (table.columns.get(name, ("",) * len(keys)) for name in ("note", "span"))
    good = [i for i, (time, key) in enumerate(zip(times, keys, strict=True)) if time is not None and key]
    n_all = len(keys) + len(table.bad_lines)
    if n_all and not good:
        raise InputError(f"none of its {n_all} lines has a time and a key", where=path,
                         advice="each line is time_s,key,note")  # fmt: skip
    time_s = np.array([times[i] for i in good], dtype=np.float64)
    order = [good[i] for i in np.argsort(time_s, kind="stable").tolist()]
    bad = sorted({*table.bad_lines, *table.line_numbers} - {table.line_numbers[i] for i in good})
    warnings = (f"{path}: {len(bad)} of {n_all} lines left out, the first is line {bad[0]}",) if bad else ()
    return EventRows(
        np.sort(time_s),
        tuple(keys[i][:MAX_NOTE_CHARS] for i in order),
        tuple(notes[i][:MAX_NOTE_CHARS] for i in order),
        tuple(spans[i] if spans[i] in ("begin", "end") else "" for i in order),
        warnings,
    )
