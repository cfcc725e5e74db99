"""What the tile store ought to return, in plain numpy; and short ways to make a store."""

import numpy as np

from linework.files.store.layout import RunTable
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index

#: Names of the further columns of test stores; a file is (xyz, intensity, time or None), and (n, 2) float32 of them.
NAMES = ("p_kerb", "p_paint")


def made(folder, files, *, limits=None, facts=None, batch=10**9):
    """Write a store of files in batches, and open it."""
    folder.mkdir(parents=True)
    tables = []
    for number, (xyz, intensity, time, *further) in enumerate(files):
        writer = StoreWriter(folder / f"{number}.points")
        for a in range(0, len(xyz), batch):
            part = slice(a, a + batch)
            columns = [np.ascontiguousarray(table[part].T) for table in further]
            writer.append(xyz[part], intensity[part], None if time is None else time[part], *columns)
        tables.append(writer.close())
    names = {"columns": list(NAMES)} if any(len(file) > 3 for file in files) else {}
    write_index(folder, RunTable.concatenate(*tables), names | (facts or {}), limits)
    return PointStore.open(folder)


def steps_of(xyz):
    return np.rint(xyz * 10_000.0).astype(np.int64)


def canonical(xyz, intensity, time, *further):
    """Return the order of points as the layout tells it, and the coordinates on the lattice."""
    steps = steps_of(xyz)
    block = steps // [640_000, 640_000, 2**24]
    local = steps - block * [640_000, 640_000, 2**24]
    cell, within = local[:, :2] // 5000, local[:, :2] % 5000
    columns = (
        *(table[:, k] for table in further for k in reversed(range(table.shape[1]))),
        intensity, time, local[:, 2], within[:, 0], within[:, 1], cell[:, 0], cell[:, 1],
        block[:, 2], block[:, 0], block[:, 1],
    )  # fmt: skip
    return np.lexsort(columns), steps / 10_000.0


def selected(files, bounds=None):
    """Return xyz, intensity, time and further columns of all files' points within bounds, in canonical order."""
    xyz, intensity, *further = (np.concatenate([f[i] for f in files]) for i in range(len(files[0])) if i != 2)
    time = np.concatenate([np.zeros(len(f[0])) if f[2] is None else f[2] for f in files])
    order, lattice = canonical(xyz, intensity, time, *further)
    found = [column[order] for column in (lattice, intensity.astype(np.float32), time, *further)]
    if bounds is not None:
        x, y = found[0][:, 0], found[0][:, 1]
        keep = (x >= bounds.west) & (x < bounds.east) & (y >= bounds.south) & (y < bounds.north)
        found = [column[keep] for column in found]
    return tuple(found)


def file_of(points):
    """Return points as a file that could have been written."""
    further = [np.stack([points[name] for name in NAMES], axis=1)] if points.columns else []
    return (points.xyz, points.intensity.astype(np.uint16), points.time_s, *further)


def assert_same(points, expected):
    xyz, intensity, time, *further = expected
    np.testing.assert_array_equal(points.xyz, xyz)
    np.testing.assert_array_equal(points.intensity, intensity)
    np.testing.assert_array_equal(points.time_s, time)
    assert tuple(points.columns) == (NAMES if further else ())
    for table in further:
        np.testing.assert_array_equal(np.stack([points[name] for name in NAMES], axis=1), table)
