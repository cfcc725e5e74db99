"""An edit of thousands of lines: what is compared, and what the worker is asked, stay bounded."""

from __future__ import annotations

import asyncio
import threading
from types import SimpleNamespace

import numpy as np

from linework.editing.edits.attributes import with_review
from linework.editing.queue.alike import line_measures
from linework.lines.along import DrivenPath
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.review import alike
from linework.workbench.review.alike import (
    MEASURED_AT_ONCE,
    MOST_EXAMPLES,
    population_of,
    taught_by,
)
from linework.workbench.review.routes import get_alike

POINTS, LINES = (f"linework.workbench.review.alike:{name}_in_worker" for name in ("points", "lines"))


def dashes(n, seed=3):
    rng = np.random.default_rng(seed)
    start = np.column_stack([6.0 * np.arange(n), rng.normal(size=n), np.zeros(n)])
    end = start + np.column_stack([rng.uniform(1.0, 4.0, n), 0.1 * rng.normal(size=n), np.zeros(n)])
    return LineSet.from_lines(
        list(np.stack([start, end], axis=1)),
        kind=["lane_marking_dash"] * n, id=[f"d{k:05d}" for k in range(n)], confidence=rng.uniform(0.5, 1.0, n),
    )  # fmt: skip


class Pictures:
    """The worker: what it was asked, lines by request; it knows nothing of points."""

    def __init__(self):
        self.asked = []

    async def ask(self, function, lines, *others):
        self.asked.append((function, len(lines)))
        if function == POINTS:
            return {"number of points": lines.length_m * 100.0}
        assert function == LINES
        path = np.column_stack([np.arange(0.0, 300.0), np.zeros(300), np.zeros(300)])
        return line_measures(lines, *others, DrivenPath.of(path))


class Page:
    """The request of a page that leaves after it was looked for some times."""

    def __init__(self, n_there=10**6):
        self.n_there = n_there

    async def is_disconnected(self):
        self.n_there -= 1
        return self.n_there < 0


def asked(n_examples, n_others, page):
    lines = dashes(n_examples + n_others)
    before = lines.take(np.arange(n_examples))
    change = Change("reject", before, with_review(before, "rejected"))
    after = LineSet.concatenate([change.after, lines.take(np.arange(n_examples, len(lines)))])
    edit = SimpleNamespace(number=1, change=change)
    file = SimpleNamespace(revision=1, undone=(), history=lambda _n: [edit], lines=after)
    pictures = Pictures()
    state = SimpleNamespace(line_file=file, pictures=pictures)
    return asyncio.run(get_alike(page, state, 1)), pictures.asked


def test_an_edit_of_thousands_of_lines_compares_some_of_them_in_short_requests():
    n_examples, n_others = 3000, 200
    found, requests = asked(n_examples, n_others, Page())
    assert found.n_looked == MOST_EXAMPLES + n_others
    assert found.items
    assert {int(item.id[1:]) for item in found.items} <= set(range(n_examples, n_examples + n_others))
    points = [n for function, n in requests if function == POINTS]
    assert sum(points) == found.n_looked and max(points) <= MEASURED_AT_ONCE
    # All lines travel once
    assert [n for function, n in requests if function == LINES] == [n_examples + n_others]


def test_the_examples_that_are_compared_do_not_depend_on_the_order_of_the_edit():
    lines = dashes(700)
    for order in (np.arange(700), np.random.default_rng(1).permutation(700)):
        some = lines.take(order)
        taught = taught_by(Change("delete", some, LineSet.empty()))
        assert len(taught.examples) == 700
        whole, chosen = population_of(taught, LineSet.empty())
        assert whole.id[chosen].tolist() == [f"d{k:05d}" for k in range(0, 700, 35)]


def test_nothing_more_is_asked_once_the_page_is_gone():
    found, requests = asked(1, 200, Page(n_there=2))
    assert found.mend is None and found.items == []
    assert len(requests) == 2


def test_the_lines_are_chosen_in_a_thread_of_their_own(monkeypatch):
    threads = []

    def noted(*given):
        threads.append(threading.current_thread())
        return population_of(*given)

    monkeypatch.setattr(alike, "population_of", noted)
    asked(1, 10, Page())
    assert threads and threading.main_thread() not in threads
