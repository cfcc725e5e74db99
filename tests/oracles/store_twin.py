"""What the tile store ought to return, in plain numpy; and short ways to make a store."""

import numpy as np

from linework.files.store.layout import RunTable
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index


def made(folder, files, *, limits=None, facts=None, batch=10**9):
    """Write a store of files (xyz, intensity, time or None) in batches, and open it."""
    folder.mkdir(parents=True)
    tables = []
    for number, (xyz, intensity, time) in enumerate(files):
        writer = StoreWriter(folder / f"{number}.points")
        for a in range(0, len(xyz), batch):
            part = slice(a, a + batch)
            writer.append(xyz[part], intensity[part], None if time is None else time[part])
        tables.append(writer.close())
    write_index(folder, RunTable.concatenate(*tables), facts or {}, limits)
    return PointStore.open(folder)


def steps_of(xyz):
    return np.rint(xyz * 10_000.0).astype(np.int64)


def canonical(xyz, intensity, time):
    """Return the order of points as the layout tells it, and the coordinates on the lattice."""
    steps = steps_of(xyz)
    block = steps // [640_000, 640_000, 2**24]
    local = steps - block * [640_000, 640_000, 2**24]
    cell, within = local[:, :2] // 5000, local[:, :2] % 5000
    columns = (
        intensity, time, local[:, 2], within[:, 0], within[:, 1], cell[:, 0], cell[:, 1],
        block[:, 2], block[:, 0], block[:, 1],
    )  # fmt: skip
    return np.lexsort(columns), steps / 10_000.0


def selected(files, bounds=None):
    """Return xyz, intensity and time of all files' points within bounds, in canonical order."""
    xyz, intensity = (np.concatenate([f[i] for f in files]) for i in (0, 1))
    time = np.concatenate([np.zeros(len(f[0])) if f[2] is None else f[2] for f in files])
    order, lattice = canonical(xyz, intensity, time)
    lattice, intensity, time = lattice[order], intensity[order].astype(np.float32), time[order]
    if bounds is not None:
        keep = (lattice[:, 0] >= bounds.west) & (lattice[:, 0] < bounds.east)
        keep &= (lattice[:, 1] >= bounds.south) & (lattice[:, 1] < bounds.north)
        lattice, intensity, time = lattice[keep], intensity[keep], time[keep]
    return lattice, intensity, time


def assert_same(points, expected):
    xyz, intensity, time = expected
    np.testing.assert_array_equal(points.xyz, xyz)
    np.testing.assert_array_equal(points.intensity, intensity)
    np.testing.assert_array_equal(points.time_s, time)
