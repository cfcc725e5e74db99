"""Where tiles are worked: in this process, several at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_order(work: Callable[[Item], Result], items: Iterable[Item], n_workers: int) -> Iterator[Result]:
    """Yield ``work(item)`` for each item, in the items' order, whatever the number of workers.

    Threads serve: kernels and numpy let go of the interpreter's lock.

    >>> list(in_order(lambda x: x * x, [1, 2, 3], n_workers=2))
    [1, 4, 9]
    """
    if n_workers == 1:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(max_workers=n_workers) as pool:
        yield from pool.map(work, items)
