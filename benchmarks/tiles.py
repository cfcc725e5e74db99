"""Tiles of the plan view while panning along a drive: median and p95 end to end at each zoom, and memory.

    python -m benchmarks.tiles [SURVEY [WORK]]      (a drive of 50 million points is made if none is given)

`linework serve` runs as a user runs it, and tiles are asked for as a browser asks: six at a time, those of a window
of 1280 x 800 pixels that moves by half of its width along the van's way. The first picture of a survey is measured
too: how long until the overview is whole. The reference is decoding the points of a block of 64 m, by the store
alone, on the same machine.
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx
import numpy as np

from benchmarks.large import make_survey, memory_of
from linework.files.store.read import PointStore
from linework.model.grid import Bounds

#: Takes long: not among those that are run without being named.
ON_REQUEST = True
WINDOW_PX, AT_ONCE, N_WINDOWS = (1280, 800), 6, 10
IMAGES = ("intensity", "height", "above_road", "density")


def main(*arguments: str) -> None:
    """Serve a survey and measure."""
    with tempfile.TemporaryDirectory(prefix="linework-tiles-") as name:
        survey = Path(arguments[0]) if arguments else make_survey(Path(name) / "drive", 50_000_000)
        work = Path(arguments[1]) if len(arguments) > 1 else Path(name) / "work"
        command = [sys.executable, "-m", "linework", "serve", str(survey), "--lines", f"{name}/lines.gpkg",
                   "--work", str(work), "--no-browser", "--quiet"]  # fmt: skip
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                link = next(
                    word for line in process.stdout for word in line.split() if word.startswith("http")
                )
                asyncio.run(measure(link, process.pid, work))
            finally:
                process.terminate()


async def measure(link: str, pid: int, work: Path) -> None:
    """Print what there is to say."""
    base = link.partition("/?")[0]
    limits = httpx.Limits(max_connections=AT_ONCE)
    async with httpx.AsyncClient(
        base_url=base, headers={"Origin": base}, limits=limits, timeout=120
    ) as client:
        await client.get(link)
        survey = (await client.get("/api/survey")).json()
        print(f"{survey['n_points']:,} points", flush=True)
        reference_s = decoding_s(work)
        print(f"decoding a block of 64 m, median: {1e3 * reference_s:.1f} ms")
        path, tiles = np.array(survey["path"])[:, :2], survey["tiles"]
        start = time.perf_counter()
        seconds, _ = await asked(client, "density", 0, tiles, path[len(path) // 3])
        print(f"first tile of all: {seconds:.2f} s")
        await overview(client, start)
        most = memory_of(pid)
        for z, resolution in enumerate(tiles["resolutions"]):
            took, sizes = [], []
            for image in IMAGES:
                seen: set[tuple[int, int]] = set()
                for places in windows(path, resolution):
                    found = await panned(client, image, z, tiles, places, seen)
                    took += [seconds for seconds, size in found if size]
                    sizes += [size for _, size in found if size]
                    most = max(most, memory_of(pid))
            if took:
                median, late = np.quantile(took, (0.5, 0.95))
                print(
                    f"{resolution:9.4f} m: {len(took):5d} tiles, median {1e3 * median:6.1f} ms, p95 {1e3 * late:6.1f} ms,"
                    f" {median / reference_s:5.2f} times a block's decoding; {np.median(sizes) / 1e3:5.1f} kB",
                    flush=True,
                )
        print(f"memory of the server and its workers at most {most / 1e9:.2f} GB")


async def overview(client: httpx.AsyncClient, start: float) -> None:
    """Wait until the coarsest tile no longer changes while nobody asks: then all of it is there."""
    before, since = b"", time.perf_counter()
    while time.perf_counter() - since < 6.0:
        await asyncio.sleep(2.0)
        now = b"".join(
            [
                (await client.get(f"/api/tiles/density/0/{col}/{row}")).content
                for col in (0, 1)
                for row in (0, 1)
            ]
        )
        if now != before:
            before, since = now, time.perf_counter()
    print(f"overview whole after {since - start:.1f} s", flush=True)


def windows(path: np.ndarray, resolution: float) -> list[np.ndarray]:
    """Return the places of the tiles' middles in windows that move along the way, window by window."""
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T))]
    tile_m = 256 * resolution
    cols, rows = (int(np.ceil(px / 256)) for px in WINDOW_PX)
    grid = np.stack(np.meshgrid(np.arange(cols) - cols / 2, np.arange(rows) - rows / 2), axis=-1).reshape(
        -1, 2
    )
    stations = 0.3 * along[-1] + np.arange(N_WINDOWS) * 0.5 * WINDOW_PX[0] * resolution
    stations = stations[stations < along[-1]][:N_WINDOWS]
    middles = np.stack([np.interp(stations, along, path[:, k]) for k in (0, 1)], axis=1)
    return [middle + grid * tile_m for middle in middles]


async def panned(client, image, z, tiles, places, seen):
    """Ask for the tiles of a window together, but for those that a browser has."""
    new = {tile_of(z, tiles, place): place for place in places}
    new = {number: place for number, place in new.items() if number not in seen}
    seen.update(new)
    return await asyncio.gather(*(asked(client, image, z, tiles, place) for place in new.values()))


def tile_of(z, tiles, place):
    size = tiles["tile_px"] * tiles["resolutions"][z]
    west, north = tiles["origin"]
    return int((place[0] - west) // size), int((north - place[1]) // size)


_TURN = None


async def asked(client, image, z, tiles, place):
    """Return the seconds that a tile took from when a connection was free, and its bytes."""
    global _TURN
    _TURN = _TURN or asyncio.Semaphore(AT_ONCE)
    col, row = tile_of(z, tiles, place)
    async with _TURN:
        start = time.perf_counter()
        answer = await client.get(f"/api/tiles/{image}/{z}/{col}/{row}")
        assert answer.status_code in (200, 204), answer.text
        return time.perf_counter() - start, len(answer.content)


def decoding_s(work: Path) -> float:
    """Return the median time of decoding a block with the store alone."""
    folder = max((work / "stores").iterdir(), key=lambda path: path.stat().st_mtime)
    store = PointStore.open(folder)
    blocks, counts = store.block_counts
    chosen = blocks[np.argsort(counts)[-60:]] * 64.0
    took = []
    for east, north in [*chosen[:2], *chosen]:
        start = time.perf_counter()
        store.points(Bounds(east, north, east + 64.0, north + 64.0), ordered=False)
        took.append(time.perf_counter() - start)
    return float(np.median(took[2:]))


if __name__ == "__main__":
    main(*sys.argv[1:])
