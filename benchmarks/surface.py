"""The surface of a survey: ns a point for each of its passes, and ms for a place.

CPU time of this process, best of three; points from the tile store, one after the other on one core.
"""

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from linework.files.store.layout import RunTable
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index
from linework.model.grid import Bounds
from linework.processes.executors import Serial
from linework.runs.opened.surface import SurfaceTiling, make_surface
from linework.simulation.simulate import simulate_survey
from linework.surface.config import RoadConfig

BATCH = 500_000


class Timed(Serial):
    """Adds up the CPU time of each pass."""

    def __init__(self):
        self.seconds = Counter()

    def run(self, work, tasks):
        start = time.process_time()
        yield from super().run(work, tasks)
        self.seconds[work.__name__] += time.process_time() - start


def stored(folder, points):
    writer = StoreWriter(folder / "0.points")
    for start in range(0, len(points), BATCH):
        part = points.take(slice(start, start + BATCH))
        writer.append(part.xyz, np.zeros(len(part), np.uint16), part.time_s)
    write_index(folder, RunTable.concatenate(writer.close()), {})
    return PointStore.open(folder)


def main():
    length_m = float(sys.argv[1]) if len(sys.argv) > 1 else 1000.0
    layout = SurfaceTiling(int(sys.argv[2])) if len(sys.argv) > 2 else None
    survey = simulate_survey("bends", 3, length_m, points_per_m=4000)
    n = len(survey.points)
    print(
        f"{n:,} points of a simulated drive of {length_m:.0f} m (asked for: 60 ns a point, 60 ms for 600 m x 600 m)"
    )
    with tempfile.TemporaryDirectory() as name:
        store, best = stored(Path(name), survey.points), Counter()
        for i in range(4):  # the first compiles
            timed, start = Timed(), time.process_time()
            folder = Path(name) / f"surface-{i}"
            surface = make_surface(
                store, survey.trajectory, RoadConfig(), folder, timed, lambda *_: None, key="", layout=layout
            )
            timed.seconds["all"] = time.process_time() - start
            best = min(best or timed.seconds, timed.seconds, key=lambda seconds: seconds["all"])
        for step, seconds in best.items():
            print(f"  {step:<16}{seconds / n * 1e9:6.1f} ns a point")
        size = sum(path.stat().st_size for path in folder.iterdir())
        east, north = survey.trajectory.xyz[len(survey.trajectory) // 2, :2]
        start = time.process_time()
        for _ in range(5):
            surface.over(Bounds(east - 300, north - 300, east + 300, north + 300))
        print(
            f"  over 600 m x 600 m  {(time.process_time() - start) / 5 * 1e3:.1f} ms; {size / n:.1f} bytes a point on disk"
        )


if __name__ == "__main__":
    main()
