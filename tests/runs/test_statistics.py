"""Statistics that are counted a block at a time are those of all values at once."""

import numpy as np
import pytest

from linework.runs.opened import statistics
from linework.runs.opened.statistics import GAP_S, CountedValues, TimeSpans


@pytest.fixture(params=[10, 1_000_000])
def most_waiting(request, monkeypatch):
    monkeypatch.setattr(statistics, "_MOST_WAITING", request.param)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.usefixtures("most_waiting")
def test_quantiles_are_those_of_all_values(seed):
    rng = np.random.default_rng(seed)
    parts = [np.round(rng.normal(100.0, 5.0, n), 2) for n in rng.integers(1, 200, 12)]
    counted = CountedValues()
    for part in parts:
        counted.add(part)
    whole = np.concatenate(parts)
    assert counted.counts.sum() == len(whole)
    for share in (0.0, 0.05, 0.5, 0.95, 1.0):
        assert counted.quantile(share) == pytest.approx(np.quantile(whole, share), abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.usefixtures("most_waiting")
def test_gaps_are_those_of_all_times_in_order(seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.choice([0.01, 0.4, 0.999, 1.0, 1.001, 7.0], 500)) + 3.0e8
    spans = TimeSpans()
    for part in np.array_split(rng.permutation(times), 9):
        spans.add(part)
    at = np.flatnonzero(np.diff(times) > GAP_S)
    assert len(at) > 10
    assert spans.gaps().tolist() == np.column_stack([times[at], times[at + 1]]).tolist()
    assert (spans.spans()[0, 0], spans.spans()[-1, 1]) == (times[0], times[-1])


def test_one_value_is_all_its_quantiles():
    counted = CountedValues()
    counted.add(np.array([2.5]))
    assert [counted.quantile(share) for share in (0.0, 0.5, 1.0)] == [2.5, 2.5, 2.5]
