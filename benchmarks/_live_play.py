"""Plays a survey back: a folder that fills as a van's programs would fill it, line by line and image by image.

``python -m benchmarks._live_play FROM TO`` plays the survey in FROM into TO in real time.
"""

import argparse
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

KEYS = ("manhole", "sign", "tree", "parked car", "lamp", "roadworks")
SPANS = ("cracked", "noise barrier")


def live_toml(keys=KEYS, spans=SPANS):
    """The keys of the page, as a part of a survey.toml."""
    return "".join(f'\n[[live.keys]]\nname = "{name}"\n' for name in keys) + "".join(
        f'\n[[live.keys]]\nname = "{name}"\nkind = "span"\n' for name in spans
    )


@dataclass
class Player:
    """A survey that is played back.

    Parameters
    ----------
    source, target
        The whole survey, and the folder that fills.
    speed
        1: in real time.
    repeat
        The images are given as often, one round after the other, where the logs are longer.
    chunk_s
        Programs write their logs in pieces of this length [s].
    """

    source: Path
    target: Path
    speed: float = 1.0
    chunk_s: float = 0.1
    rate_hz: float = 0.0
    events: tuple = ()

    def begin(self):
        """Make the folder, with its survey.toml and lists without images."""
        self.target.mkdir(parents=True, exist_ok=True)
        text = (self.source / "survey.toml").read_text()
        # Points and trajectory are not there while a van drives
        head, *tables = text.split("\n[")
        kept = [t for t in tables if not t.startswith(("points]", "trajectory]", "live]", "[live."))]
        (self.target / "survey.toml").write_text("\n[".join([head, *kept]) + live_toml())
        for side in ("left", "right"):
            (self.target / side).mkdir(exist_ok=True)
        self.logs = {name: rows_of(self.source / f"{name}.csv") for name in ("gnss", "gyro", "wheels")}
        self.images = {side: listed(self.source / f"{side}.csv") for side in ("left", "right")}
        self.start_s = min(rows[0][0] for _, rows in self.logs.values())
        self.end_s = max(rows[-1][0] for _, rows in self.logs.values())
        for name, (header, _) in self.logs.items():
            (self.target / f"{name}.csv").write_text(header + "\n")
        for side in self.images:
            (self.target / f"{side}.csv").write_text("file,time_s\n")
        return self

    def play(self, stop=None):
        """Fill the folder until the drive is over, or `stop` is set."""
        events = self.events or self.timeline()
        began = time.monotonic()
        handles = {
            name: (self.target / f"{name}.csv").open("a")
            for name in ("gnss", "gyro", "wheels", "left", "right")
        }
        for at_s, name, text, image in events:
            wait = (at_s - self.start_s) / self.speed - (time.monotonic() - began)
            if wait > 0:
                time.sleep(wait)
            if stop is not None and stop.is_set():
                break
            if image is not None:
                # As cameras do: the file is there, half written, before its line is in the list
                source, target = image
                data = source.read_bytes()
                with target.open("wb") as file:
                    file.write(data[: len(data) // 2])
                    file.flush()
                    handles[name].write(text)
                    handles[name].flush()
                    file.write(data[len(data) // 2 :])
            else:
                handles[name].write(text)
                handles[name].flush()
        for handle in handles.values():
            handle.close()

    def timeline(self):
        """What is written when: (time, file, text, image)."""
        events = []
        for name, (_, rows) in self.logs.items():
            starts = np.arange(self.start_s, self.end_s + 2.0 * self.chunk_s, self.chunk_s)
            first = np.searchsorted([at for at, _ in rows], starts)
            for start, a, b in zip(starts[:-1], first[:-1], first[1:], strict=True):
                if a < b:
                    text = "".join(line + "\n" for _, line in rows[a:b])
                    events.append((start + self.chunk_s, name, text, None))
        for side, images in self.images.items():
            for k, (at, name) in enumerate(self.shown(images)):
                target = f"{side}/{k:06d}{Path(name).suffix}"
                line = f"{target},{at:.6f}\n"
                events.append((at + 0.03, side, line, (self.source / name, self.target / target)))
        self.events = tuple(sorted(events, key=lambda event: event[0]))
        return self.events

    def shown(self, images):
        """Times and files of the images; with `rate_hz` the whole drive long, again and again."""
        if not self.rate_hz:
            return images
        times = np.arange(self.start_s + 0.5, self.end_s - 0.2, 1.0 / self.rate_hz)
        return [(float(at), images[k % len(images)][1]) for k, at in enumerate(times)]


def rows_of(path):
    """Header and (time, line) of a log."""
    header, *lines = path.read_text().splitlines()
    return header, [(float(line.partition(",")[0]), line) for line in lines]


def listed(path):
    """(time, file) of a list of images."""
    rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
    return [(float(time_s), name) for name, time_s in rows]


def main():
    parser = argparse.ArgumentParser(prog="python -m benchmarks._live_play")
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--speed", type=float, default=1.0)
    options = parser.parse_args()
    shutil.rmtree(options.target, ignore_errors=True)
    Player(options.source, options.target, options.speed).begin().play()


if __name__ == "__main__":
    main()
