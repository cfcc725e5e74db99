"""Memory and disk of each command on the files that are worst for it, against what the documentation promises.

Each is a process of its own that imports and opens everything anew. Memory is the sum over the command and what it
started, looked at twenty times a second; disk is everything that is written, work folder included.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tests.campaign.commands import Ended, judge_ending, make_scene
from tests.campaign.ledger import Step, Trial
from tests.campaign.mutants.laser_reader import LIES, with_lie
from tests.campaign.soak import usage_of

#: Interpreter, libraries and compiled kernels of a command. [MB]
PROGRAM_MB = 450.0
#: docs/large-surveys.md: for the process that decodes, and for each point of a tile in each worker.
DECODER_MB, POINT_BYTES = 250.0, 150.0
#: docs/large-surveys.md: the store, and the surface, for each point.
STORE_BYTES, SURFACE_BYTES = 18.0, 5.0
#: docs/limits.md: a file of lines is held in memory, and a GeoPackage has a row for each vertex: 15 and 3, with a
#: margin for shorter numbers. [times its size]
LINES_MEMORY, LINES_DISK = 17.0, 3.5
#: A refusal reads a header: no more memory than importing takes, and nothing is left on the disk.
REFUSED_DISK_MB = 1.0
#: A command on any of these files. [s]
LIMIT_S = 300.0


@dataclass(frozen=True)
class Worst:
    """A file that is bad for a command, and what is promised for it.

    Parameters
    ----------
    make
        Writes it into a folder and returns (path, points).
    words
        Arguments of the command, with {file} and {out}.
    refused
        It may be refused. A header that lies has to be, or what can be read in spite of it is said to be so.
    """

    name: str
    make: Callable[[Path], tuple[Path, int]]
    words: tuple[str, ...]
    refused: bool = False

    def promised(self, n_points: int, file_mb: float) -> tuple[float, float]:
        """Return the memory and the disk that it may take at most. [MB]"""
        if self.words[0] in ("convert", "evaluate"):
            return PROGRAM_MB + LINES_MEMORY * file_mb, LINES_DISK * file_mb
        if not n_points:
            return PROGRAM_MB + DECODER_MB, REFUSED_DISK_MB
        memory = PROGRAM_MB + DECODER_MB + POINT_BYTES * n_points / 1e6
        # A block of the surface is a file of cells, however few of them are used; outputs are some kilobytes
        return memory, (STORE_BYTES + SURFACE_BYTES) * n_points / 1e6 + 25.0


def _las(folder: Path, xyz: np.ndarray) -> tuple[Path, int]:
    from linework.files.las.write import write_las
    from linework.model.points import Points

    path = folder / "worst.laz"
    n = len(xyz)
    intensity = (np.arange(n) % 4000).astype(np.float32)
    write_las(
        Points(xyz, intensity=intensity, time_s=np.linspace(3e8, 3e8 + 60, n)), path, crs="EPSG:25832+7837"
    )
    return path, n


def sparse(folder: Path) -> tuple[Path, int]:
    """Write 60,000 points over 60 x 60 km."""
    rng = np.random.default_rng(1)
    return _las(folder, rng.uniform([400_000, 5_400_000, 0], [460_000, 5_460_000, 100], (60_000, 3)))


def lone(folder: Path) -> tuple[Path, int]:
    """Write a strip of road and one point 3,000 km away."""
    rng = np.random.default_rng(2)
    xyz = rng.uniform([500_000, 5_400_000, 100], [500_100, 5_400_010, 100.02], (40_000, 3))
    xyz[-1] = (500_000, 8_400_000, 100)
    return _las(folder, xyz)


def dense(folder: Path) -> tuple[Path, int]:
    """Write two million points on 10 x 10 m."""
    rng = np.random.default_rng(3)
    return _las(folder, rng.uniform([500_000, 5_400_000, 100], [500_010, 5_400_010, 100.02], (2_000_000, 3)))


def tall(folder: Path) -> tuple[Path, int]:
    """Write 200,000 points on a tower of 10 km."""
    rng = np.random.default_rng(4)
    return _las(folder, rng.uniform([500_000, 5_400_000, 0], [500_040, 5_400_040, 10_000], (200_000, 3)))


def lying(name: str, suffix: str) -> Callable[[Path], tuple[Path, int]]:
    """Return what writes a file of 100,000 points with a lie in its header."""

    def make(folder: Path) -> tuple[Path, int]:
        from tests.scenes.laser_files import drive_file

        _, part, place, form, value = next(lie for lie in LIES if lie[0] == name)
        sound = drive_file(folder / f"sound.{suffix}", 6, 100_000)
        path = folder / f"lie.{suffix}"
        path.write_bytes(with_lie(sound.read_bytes(), part, place, form, value))
        sound.unlink()
        return path, 100_000

    return make


def long_table(folder: Path) -> tuple[Path, int]:
    """Write a trajectory of 200 MB."""
    path = folder / "path.csv"
    block = "".join(f"{i}.000000,{500_000 + i}.000000,5400000.000000,100.000000\n" for i in range(100_000))
    with path.open("w") as file:
        file.write("time_s,easting_m,northing_m,height_m\n")
        while file.tell() < 200_000_000:
            file.write(block)
    return path, 0


def big_json(folder: Path) -> tuple[Path, int]:
    """Write a GeoJSON of 120 MB whose numbers are nested in lists."""
    path = folder / "lines.geojson"
    row = (
        '{"type":"Feature","properties":{"kind":"cable"},"geometry":{"type":"LineString","coordinates":[%s]}}'
    )
    text = row % ",".join(f"[{i},{i},1.5]" for i in range(20_000))
    with path.open("w") as file:
        file.write('{"type":"FeatureCollection","features":[')
        file.write(",".join([text] * 300))
        file.write("]}")
    return path, 0


_EXTRACT = (
    "extract",
    "{file}",
    "-o",
    "{out}/lines.gpkg",
    "--workers",
    "1",
    "--quiet",
    "--work",
    "{out}/work",
)
_INFO = ("info", "{file}", "--quiet", "--crs", "local", "--work", "{out}/work")
_RASTER = ("raster", "{file}", "-o", "{out}/images", "--quiet", "--work", "{out}/work")
#: Headers that lie in the ways that cost other readers most.
_LIES = (
    ("4e9 points", "las"), ("4e9 VLRs", "las"), ("4e9 EVLRs", "las"), ("4e9 chunks", "laz"), ("chunk table at 2^62", "laz"),
    ("item of 65535 bytes", "laz"), ("chunk layer of 4 GB", "laz"),
)  # fmt: skip
WORST = (
    Worst("extract: 60,000 points over 60 x 60 km", sparse, _EXTRACT, refused=True),
    Worst("raster: 60,000 points over 60 x 60 km", sparse, _RASTER, refused=True),
    Worst("extract: one point 3,000 km away", lone, _EXTRACT),
    Worst("extract: 2 million points on 10 x 10 m", dense, _EXTRACT),
    Worst("raster: 2 million points on 10 x 10 m", dense, _RASTER),
    Worst("extract: a tower of 10 km", tall, _EXTRACT),
    *(Worst(f"info: header with {name} ({suffix})", lying(name, suffix), _INFO, refused=True) for name, suffix in _LIES),
    Worst("extract: a trajectory of 200 MB", long_table,
          ("extract", "{drive}", "-o", "{out}/lines.gpkg", "--trajectory", "{file}", "--quiet", "--work", "{out}/work"),
          refused=True),
    Worst("convert: a GeoJSON of 120 MB", big_json, ("convert", "{file}", "{out}/lines.gpkg"), refused=True),
    Worst("evaluate: a GeoJSON of 120 MB", big_json, ("evaluate", "{file}", "{drive}/truth.gpkg"), refused=True),
)  # fmt: skip


def trials(folder: Path, share: float) -> Iterator[tuple[str, Callable[[], Trial]]]:
    """Yield a trial per bad file."""
    scene = make_scene(folder / "scene")
    chosen = WORST if share >= 0.5 else WORST[6:8]
    for worst in chosen:
        yield worst.name, lambda worst=worst: measured(worst, folder / "bounds", scene.folder / "drive")


def measured(worst: Worst, folder: Path, drive: Path) -> Trial:
    """Run the command on the file, and compare its memory and disk with the promise."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    path, n_points = worst.make(folder)
    words = [word.format(file=path, out=folder / "out", drive=drive) for word in worst.words]
    start, peak, disk = time.monotonic(), 0.0, 0.0
    with (
        (folder / "stderr").open("w+") as err,
        subprocess.Popen(
            [sys.executable, "-m", "linework", *words],
            stdout=subprocess.DEVNULL,
            stderr=err,
            start_new_session=True,
        ) as process,
    ):
        while process.poll() is None and time.monotonic() - start < LIMIT_S:
            peak = max(peak, usage_of(process.pid)[0])
            disk = max(disk, disk_mb(folder / "out"))
            time.sleep(0.05)
        hung = process.poll() is None
        if hung:
            process.kill()
        code = process.wait()
        err.seek(0)
        said = err.read()
    seconds = time.monotonic() - start
    disk = max(disk, disk_mb(folder / "out"))
    # Where a header is refused, no point is read
    n_read = 0 if code != 0 and "header" in worst.name else n_points
    memory_promised, disk_promised = worst.promised(n_read, path.stat().st_size / 1e6)
    trial = Trial(
        figures={
            "MB": round(peak), "MB promised": round(memory_promised), "disk MB": round(disk, 1),
            "disk MB promised": round(disk_promised, 1), "s": round(seconds, 1), "exit": code,
        }
    )  # fmt: skip
    judge_ending(trial, Ended(code, seconds, "", said, hung=hung), worst.name, folder)
    if peak > memory_promised:
        trial.blame("other faults", f"{worst.name}: {peak:.0f} MB, promised {memory_promised:.0f}")
    if disk > disk_promised:
        trial.blame("other faults", f"{worst.name}: {disk:.0f} MB on the disk, promised {disk_promised:.0f}")
    if not worst.refused and code not in (0, 4):
        trial.blame("other faults", f"{worst.name}: exit {code}: {said[-300:]}")
    if code == 0 and "header" in worst.name and "warning:" not in said:
        trial.blame("silent losses", f"{worst.name}: a lie was believed")
    shutil.rmtree(folder)
    return trial


def disk_mb(folder: Path) -> float:
    """Return what a folder takes on the disk. [MB]"""
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_blocks * 512
        except OSError:
            continue
    return total / 1e6


STEP = Step("bounds", "memory and disk on the worst files", trials)
