"""The tile store: ns a point for writing, and for reading as they come and in canonical order; with further columns too.

CPU time of this thread, best of five: the disk is not what is measured.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from linework.files.store.from_points import store_points
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index
from linework.model.grid import Bounds, Grid, Image
from linework.model.points import Points
from linework.simulation.simulate import simulate_survey

BATCH = 500_000


def best_ns(call, n_points):
    """Return the shortest of five; a first call, which compiles, is not timed."""
    call()
    times = []
    for _ in range(5):
        start = time.thread_time()
        call()
        times.append(time.thread_time() - start)
    return min(times) / n_points * 1e9


def write(path, columns):
    writer = StoreWriter(path)
    for start in range(0, len(columns[0]), BATCH):
        writer.append(*(column[..., start : start + BATCH] if i == 3 else column[start : start + BATCH]
                        for i, column in enumerate(columns)))  # fmt: skip
    return writer


def main():
    points = simulate_survey("bends", 3, 300.0, points_per_m=4000).points
    n = len(points)
    scan = points.xyz, points.intensity.astype(np.uint16), points.time_s
    order = np.random.default_rng(0).permutation(n)
    mixed = tuple(column[order] for column in scan)
    more = *scan, np.random.default_rng(2).random((2, n), dtype=np.float32)
    array = Points(points.xyz, intensity=points.intensity, time_s=points.time_s)
    print(f"{n:,} points of a simulated drive, batches of {BATCH:,} (asked for: 25, 20 and 50 ns a point)")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for what, columns in (("scan", scan), ("random", mixed), ("scan, 2 further columns, in", more)):
            ns = best_ns(lambda columns=columns: write(folder / "9.points", columns).abort(), n)
            print(f"  write, {what} order   {ns:6.1f} ns a point")
        ns = best_ns(lambda: store_points(array, Path(tempfile.mkdtemp(dir=folder))), n)
        print(f"  store an array         {ns:6.1f} ns a point")
        (folder / "more").mkdir()
        write_index(
            folder / "more", write(folder / "more" / "0.points", more).close(), {"columns": ["a", "b"]}
        )
        write_index(folder, write(folder / "0.points", scan).close(), {})
        store = PointStore.open(folder)
        w, s, e, north = store.bounds
        part, grid = Bounds(w + 10, s + 10, e - 10, north - 10), Grid.covering(store.bounds, 0.5)
        low = Image(np.full(grid.shape, points.xyz[:, 2].min(), np.float32), grid)
        for what, options in (
            ("all, as they come", {"ordered": False}),
            ("all, in order", {}),
            ("part, in order", {"bounds": part}),
            ("part, in order, above lowest", {"bounds": part, "lowest": low}),
        ):
            ns = best_ns(lambda options=options: store.points(**options), len(store.points(**options)))
            print(f"  read {what:<30}{ns:6.1f} ns a point")
        ns = best_ns(PointStore.open(folder / "more").points, n)
        print(f"  read all, in order, 2 further columns  {ns:6.1f} ns a point")
        keys = np.random.default_rng(1).integers(0, 2**64, n, dtype=np.uint64)
        print(f"  numpy's argsort of so many keys    {best_ns(lambda: np.argsort(keys), n):6.1f} ns a point")


if __name__ == "__main__":
    main()
