"""The review queue of a drawing: found once for a revision, without what somebody has settled."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

from linework.editing.queue.suspects import Suspect
from linework.files.line_file.file import LineFile
from linework.lines.along import DrivenPath
from linework.model.changes import Change
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.workbench.edits.orders import ChangeOrder
from linework.workbench.review.queue import (
    MOST_ITEMS,
    Dismissed,
    ReviewQueue,
    found_in_parts,
    queue_item,
    queue_items,
)
from linework.workbench.review.suspects import suspects
from linework.workbench.worker.process import worker_function

PATH = np.column_stack([np.arange(0.0, 200.0), np.zeros(200), np.zeros(200)])


def everywhere(xy):
    return np.ones(len(xy), dtype=bool)


def marking(start, end, **columns):
    t = np.arange(start, end + 0.5)
    xyz = np.column_stack([t, np.full(len(t), 1.7), np.zeros(len(t))])
    return LineSet.from_lines([xyz], kind=["lane_marking"], **columns)


@pytest.fixture
def line_file(tmp_path):
    with LineFile.opened(tmp_path / "lines.gpkg", crs="local") as line_file:
        lines = LineSet.concatenate([marking(0, 100), marking(110, 200), marking(50, 60, confidence=[0.2])])
        line_file.commit(Change("extract", LineSet.empty(), lines), who="")
        yield line_file


def say(line_file, action, before, after):
    return line_file.commit(Change(action, before, after), who="tester", based_on=line_file.revision)


class Counting:
    """Finds what is worth a look, and counts how often it is asked."""

    def __init__(self):
        self.n = 0

    async def __call__(self, lines, dismissed):
        self.n += 1
        return suspects(lines, DrivenPath.of(PATH), everywhere, dismissed=dismissed)


def keys(queue):
    return [item.key for item in asyncio.run(queue.items())]


def test_the_queue_is_found_once_for_a_revision(line_file):
    find = Counting()
    queue = ReviewQueue(line_file, find)
    before = keys(queue)
    assert keys(queue) == before
    assert find.n == 1
    assert any(key.startswith("gap lane_marking") for key in before)
    unsure = next(key for key in before if key.startswith("line "))
    line = line_file.lines.take(line_file.lines.confidence == 0.2)
    say(line_file, "reject", line, line.with_columns(review=np.array(["rejected"])))
    assert unsure not in keys(queue)
    assert find.n == 2


def test_a_worker_is_asked_part_by_part_for_the_same_items():
    """Pictures wait for a request that the worker runs: what takes longest is not one."""
    lines = LineSet.concatenate(
        [
            marking(0, 100, id=["a"]),
            marking(110, 200, id=["b"]),
            marking(50, 60, id=["c"], confidence=[0.2]),
            marking(0, 70, id=["d"]).with_columns(kind=np.array(["guardrail"])),
        ]
    )
    given = {
        "path": DrivenPath.of(PATH),
        "sight": everywhere,
        "paint of lines": SimpleNamespace(of=lambda *_: {}),
    }
    session, asked = SimpleNamespace(keep=lambda name, _: given[name]), []

    async def ask(function, *arguments):
        asked.append(arguments[1])
        return worker_function(function)(session, *arguments)

    whole = suspects(lines, given["path"], everywhere, {})
    assert {"copy", "gap", "stretch"} <= {suspect.type for suspect in whole}
    dismissed = frozenset(suspect.key for suspect in whole if suspect.type == "copy")
    for settled in (frozenset(), dismissed):
        asked.clear()
        found = asyncio.run(found_in_parts(ask, lines, settled))
        assert found == suspects(lines, given["path"], everywhere, {}, settled)
        # Copies of two kinds, lines, gaps, wires, dashes, and that there is no more
        assert asked[:-1] == list(range(7))


def test_what_is_dismissed_stays_away_until_that_is_undone(line_file):
    queue = ReviewQueue(line_file, Counting())
    first, *rest = keys(queue)
    none = LineSet.empty(line_file.lines.crs)
    say(line_file, f"dismiss {first}", none, none)
    assert keys(queue) == rest
    # Also for a workbench that is started anew
    assert keys(ReviewQueue(line_file, Counting())) == rest
    line_file.undo(who="tester")
    assert keys(queue) == [first, *rest]
    line_file.redo(who="tester")
    assert keys(queue) == rest


def test_only_new_edits_are_read_for_dismissals(line_file, monkeypatch):
    dismissed, none = Dismissed(), LineSet.empty(line_file.lines.crs)
    say(line_file, "dismiss a b", none, none)
    assert dismissed.keys(line_file) == {"a b"}
    asked = []
    monkeypatch.setattr(LineFile, "entries", lambda _, most: asked.append(most) or [])
    say(line_file, "dismiss c", none, none)
    dismissed.keys(line_file)
    dismissed.keys(line_file)
    assert asked == [1]


def test_a_joined_gap_is_no_gap(line_file):
    queue = ReviewQueue(line_file, Counting())
    gap = next(item for item in asyncio.run(queue.items()) if item.type == "gap")
    ids = gap.ids
    assert len(ids) == 2
    before = line_file.lines.take(np.isin(line_file.lines.id, ids))
    say(line_file, "join", before, marking(0, 200, id=[ids[0]], review=["edited"]))
    assert gap.key not in keys(queue)


@pytest.mark.parametrize("proposal", ["accept", "reject", "join"])
def test_a_proposal_is_an_edit_that_the_door_lets_in(proposal):
    ids = ("a", "b") if proposal == "join" else ("a",)
    item = queue_item(
        Suspect(
            type="gap",
            ids=ids,
            kind="lane_marking",
            at=(1.0, 2.0),
            box=Bounds(0, 0, 5, 5),
            length_m=3.0,
            confidence=0.5,
            reason="why",
            proposal=proposal,
        )
    )
    ChangeOrder.model_validate({"revision": 0, "edit": item.proposal})


def test_items_of_many_lines_end_even_the_longest_queue():
    def suspect(type_, name):
        return Suspect(
            type=type_, ids=(name,), kind="cable", at=(1.0, 2.0), box=Bounds(0, 0, 5, 5), length_m=3.0,
            confidence=0.5, reason="why",
        )  # fmt: skip

    found = [suspect("line", str(k)) for k in range(MOST_ITEMS + 7)]
    items = queue_items([*found, suspect("rest", "a"), suspect("sure", "b")], {"line 0"})
    assert len(items) == MOST_ITEMS
    assert [item.ids for item in items[-3:]] == [[str(MOST_ITEMS - 2)], ["a"], ["b"]]
