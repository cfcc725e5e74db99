"""Whether `linework live` keeps up with a van, how much memory it takes, and whether a kill loses anything.

``python -m benchmarks.live --minutes 5`` plays a simulated drive back in real time: 5 pairs/s of 732 x 484, 20 m/s, gyro
and wheels at 100 Hz, fixes at 10 Hz. ``--kills 10`` kills the program as often on the way and starts it again. The
images of 260 m are drawn once (minutes, kept in ``--folder``) and shown again and again; the logs are of the whole drive.
"""

import argparse
import contextlib
import json
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from dataclasses import dataclass, field, replace
from pathlib import Path

import httpx
import numpy as np

from benchmarks._live_play import KEYS, Player
from linework.simulation.folder import van_grades, write_logs
from linework.simulation.sensors.logs import simulate_logs
from linework.simulation.sensors.long_drives import DriveKind, long_drive

#: Drawing its pictures takes minutes, playing them back as long as it is asked for.
ON_REQUEST = True
FOLDER = Path.home() / ".cache" / "linework-benchmarks" / "live"
SEED, LENGTH_M, SPEED_MPS, RATE_HZ = 977, 300.0, 20.0, 5.0
LOG_HZ = 100.0
#: A country road at 20 m/s; the images of a straight one are shown all the same, as what they cost does not depend on it.
ROAD = DriveKind((SPEED_MPS, SPEED_MPS), (300.0, 1500.0), 0.0, 0.0, (400.0, 2000.0), 60.0, 1.0, 0.03)
ORIGIN_M = (500_000.0, 5_600_000.0, 100.0)
ASK_S, PRESS_S, START_S = 0.5, 2.0, 300.0


@dataclass
class Watched:
    """What was measured of a drive."""

    lag_s: list = field(default_factory=list)
    rss_mb: list = field(default_factory=list)
    acknowledged: set = field(default_factory=set)
    undone: set = field(default_factory=set)
    saved_pairs: int = 0
    lost_pairs: int = 0
    lost_presses: set = field(default_factory=set)
    press_ms: list = field(default_factory=list)
    restarts_s: list = field(default_factory=list)
    kills: int = 0


def main(arguments=()):
    options = parsed(arguments)
    source = drawn(options.folder, options.minutes)
    target = options.folder / "played"
    shutil.rmtree(target, ignore_errors=True)
    player = Player(source, target, rate_hz=RATE_HZ).begin()
    output = target / "out" / "lines.gpkg"
    stop, watched = threading.Event(), Watched()
    playing = threading.Thread(target=player.play, args=(stop,), daemon=True)
    # The clock of the drive runs when the program is ready, as a van does not wait either
    started = lambda: None if playing.ident else playing.start()  # noqa: E731
    kills = np.linspace(0.0, 60.0 * options.minutes, options.kills + 2)[1:-1].tolist()
    player.timeline()  # made before the program waits for it
    began = None
    while True:
        with running(target, output) as (process, client):
            started()
            began = began or time.monotonic()
            until = began + kills.pop(0) if kills else None
            watch(process, client, watched, until)
            if until is not None and process.poll() is None:
                process.send_signal(signal.SIGKILL)
                process.wait()
                watched.kills += 1
                check_nothing_lost(target, watched)
                continue
        break
    stop.set()
    check_nothing_lost(target, watched)
    report(watched, output, options)


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.live")
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where images are kept")
    return parser.parse_args(list(arguments))


def drawn(folder, minutes):
    """The images of 260 m, and the logs of a drive of so many minutes."""
    source = folder / "source"
    if not (source / "survey.toml").is_file():
        command = ["simulate", "-o", source, "--road", "straight", "--seed", SEED, "--length-m", LENGTH_M,
                   "--points-per-m", 200, "--image-size", "732x484", "--image-every-m", 4]  # fmt: skip
        subprocess.run([sys.executable, "-m", "linework", *map(str, command)], check=True)
    grades = van_grades()
    grades = replace(grades, wheels=replace(grades.wheels, rate_hz=LOG_HZ))
    rng = np.random.default_rng(SEED)
    logs = simulate_logs(long_drive(ROAD, 60.0 * minutes, rng), grades, rng, origin_m=ORIGIN_M)
    write_logs(logs, source)
    return source


@contextlib.contextmanager
def running(target, output):
    """`linework live` on a folder, and a client with a session."""
    command = [sys.executable, "-m", "linework", "live", target, "-o", output, "--no-browser", "--quiet",
               "--until-quiet-s", 8]  # fmt: skip
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, text=True)
    try:
        link = process.stdout.readline().strip()
        url = link.partition("/?")[0]
        with httpx.Client(base_url=url, headers={"Origin": url}, timeout=20.0) as client:
            assert client.get(link).status_code == 303
            yield process, client
    finally:
        process.terminate()
        process.wait()


def watch(process, client, watched, until):
    """Ask for the state, press keys and undo some of them, until the program ends or a time comes."""
    pressed, asked, first = 0.0, time.monotonic(), True
    while process.poll() is None and (until is None or time.monotonic() < until):
        try:
            state = client.get("/api/live").json()
            if state["pairs_per_s"] and first:
                watched.restarts_s.append(time.monotonic() - asked)
                first = False
            watched.lag_s.append((time.monotonic(), state["lag_s"], state["waiting"]))
            watched.saved_pairs = max(watched.saved_pairs, state["saved_pairs"])
            watched.rss_mb.append((time.monotonic(), rss_mb(process.pid)))
            if state["time_s"] and time.monotonic() - pressed > PRESS_S:
                pressed = time.monotonic()
                press(client, watched)
        except (httpx.HTTPError, OSError):
            pass  # it has just ended
        time.sleep(ASK_S)


def press(client, watched):
    """Press a key; each fifth press is undone."""
    identity, began = str(uuid.uuid4()), time.perf_counter()
    order = {"key": KEYS[len(watched.acknowledged) % len(KEYS)], "press": identity, "ago_s": 0.0}
    if client.post("/api/live/presses", json=order).status_code == 200:
        watched.press_ms.append(1e3 * (time.perf_counter() - began))
        watched.acknowledged.add(identity)
        if len(watched.acknowledged) % 5 == 0 and (
            client.post("/api/live/undo", json={"press": identity}).status_code == 200
        ):
            watched.undone.add(identity)


def check_nothing_lost(target, watched):
    """Every press that was acknowledged is in the file, every pair that was said to be saved is in the journal."""
    text = (target / "events.csv").read_text() if watched.acknowledged else ""
    there = {line.split(",")[3] for line in text.splitlines()[1:]}
    watched.lost_presses |= (watched.acknowledged - watched.undone) - there
    watched.lost_presses |= watched.undone & there
    journal = next((target / ".linework" / "runs").glob("live-*/live.jsonl"))
    records = [
        json.loads(line) for line in journal.read_text().splitlines(keepends=True) if line.endswith("\n")
    ]
    n = sum(record.get("state") == "looked" and "pair" in record for record in records)
    watched.lost_pairs += max(watched.saved_pairs - n, 0)


def rss_mb(pid):
    """Resident memory of a process."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024.0
    return float("nan")


def report(watched, output, options):
    files = sorted(output.parent.glob("*.gpkg"), key=lambda path: (len(path.name), path.name))
    record = json.loads(files[-1].with_name(files[-1].name + ".live.json").read_text())
    lag = np.array([lag for _, lag, _ in watched.lag_s])
    times, rss = np.array(watched.rss_mb).T
    minute = times - times[0]
    print(
        f"{options.minutes:g} minutes, {record['driven_m']:,.0f} m, {watched.kills} kills, {len(files)} files"
    )
    print("pairs: " + ", ".join(f"{n:,} {name}" for name, n in record["pairs"].items()))
    print(
        f"behind: median {np.median(lag):.2f} s, 95 % {np.percentile(lag, 95):.2f} s, most {lag.max():.2f} s"
    )
    for share in np.linspace(0.0, 1.0, 6):
        at = share * minute[-1]
        print(f"  memory after {at / 60.0:4.1f} min: {rss[np.argmin(np.abs(minute - at))]:6.0f} MB")
    print(f"presses: {len(watched.acknowledged)} acknowledged, {len(watched.undone)} undone, "
          f"{len(watched.lost_presses)} lost; median {np.median(watched.press_ms or [0]):.0f} ms")  # fmt: skip
    print(f"pairs said to be saved and lost: {watched.lost_pairs}")
    print(f"first pair after a start: median {np.median(watched.restarts_s or [0]):.1f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
