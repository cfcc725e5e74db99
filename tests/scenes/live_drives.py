"""A survey folder that fills while a van drives east along a level road with known stripes, and the clock of that."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tests.scenes.road_images import RIG, STRIPES, road_pair, straight_poses

from linework.files.images.read import write_grey_png
from linework.files.survey.open import open_survey
from linework.live.drive import LiveDrive
from linework.live.kept import KeptDrive, live_folder
from linework.model.camera import LOOKING_AHEAD, Camera, StereoRig
from linework.simulation.folder import cameras_toml, van_grades, write_logs
from linework.simulation.sensors.drive import Drive
from linework.simulation.sensors.logs import simulate_logs

ORIGIN = np.array([500_000.0, 5_600_000.0, 100.0])
SPEED_MPS, PAIR_S, N_PAIRS = 15.0, 0.2, 40
#: When the first pair is taken: the van has driven far enough for a heading then, and no step ends just there. [s]
FIRST_S = 4.1
KEYS = """
[[live.keys]]
name = "manhole"

[[live.keys]]
name = "cracks, fine"
kind = "span"
"""


def write_live_source(folder: Path) -> None:
    """Write everything that the van records: images, their lists, logs, and the survey.toml."""
    seconds = FIRST_S + N_PAIRS * PAIR_S + 3.0
    time_s = np.arange(0.0, seconds, 0.01)
    x = SPEED_MPS * (time_s - FIRST_S)
    xyz = np.column_stack([x, np.full(len(x), 0.4), np.zeros(len(x))])
    nothing = np.zeros(len(x))
    drive = Drive(time_s, xyz, nothing, nothing, nothing, np.zeros_like(xyz))
    logs = simulate_logs(drive, van_grades(), np.random.default_rng(3), origin_m=tuple(ORIGIN.tolist()))
    size = {
        "width": RIG.width,
        "height": RIG.height,
        "fx": RIG.focal_px,
        "fy": RIG.focal_px,
        "cx": RIG.cx,
        "cy": RIG.cy,
    }
    left, right = (
        Camera(**size, position_m=RIG.position_m - [0.0, shift, 0.0], R_vehicle_camera=LOOKING_AHEAD)
        for shift in (0.0, RIG.base_m)
    )
    tables = cameras_toml(StereoRig(left, right)) + write_logs(logs, folder)
    head = f'name = "live test"\ncrs = "EPSG:25832+7837"\n'  # noqa: F541
    (folder / "survey.toml").write_text(head + tables + KEYS, encoding="utf-8")
    poses = straight_poses(N_PAIRS, SPEED_MPS * PAIR_S)
    for side in ("left", "right"):
        (folder / side).mkdir()
    rows = []
    for i in range(N_PAIRS):
        pair = road_pair(i, poses)
        for side, image in (("left", pair.left), ("right", pair.right)):
            write_grey_png(image, folder / side / f"{i:04d}.png")
        rows.append(f"{i:04d}.png,{FIRST_S + i * PAIR_S:.3f}")
    for side in ("left", "right"):
        lines = [f"{side}/{row}" for row in rows]
        (folder / f"{side}.csv").write_text("file,time_s\n" + "\n".join(lines) + "\n", encoding="utf-8")


@dataclass
class Filling:
    """A folder that is filled from a source, up to a time of the drive, and what follows it.

    Parameters
    ----------
    time_s
        The survey's time up to which the folder is filled.
    stopped
        Files that get nothing more: "gyro", "left" ...
    """

    source: Path
    folder: Path
    time_s: float = 0.0
    stopped: set[str] = field(default_factory=set)
    lines: list[str] = field(default_factory=list)

    def begin(self) -> Filling:
        self.folder.mkdir()
        shutil.copy(self.source / "survey.toml", self.folder)
        for side in ("left", "right"):
            (self.folder / side).mkdir()
        for name in ("gnss", "gyro", "wheels", "left", "right"):
            header = (self.source / f"{name}.csv").read_text().split("\n")[0]
            (self.folder / f"{name}.csv").write_text(header + "\n")
        return self

    @property
    def now_s(self) -> float:
        """The clock of the machine: of another start than the survey's."""
        return self.time_s + 1000.0

    def fill(self, until_s: float, *, only: set[str] | None = None) -> None:
        """Append to all files what the van records until a time."""
        for name in ("gnss", "gyro", "wheels", "left", "right"):
            if name not in self.stopped and (only is None or name in only):
                self.append(name, self.rows(name, self.time_s, until_s))
        self.time_s = until_s

    def rows(self, name: str, from_s: float, until_s: float) -> list[str]:
        """Return the lines of a file for a time."""
        at = -1 if name in ("left", "right") else 0
        lines = (self.source / f"{name}.csv").read_text().splitlines()[1:]
        return [line for line in lines if from_s <= float(line.split(",")[at]) < until_s]

    def append(self, name: str, rows: list[str], *, images: bool = True) -> None:
        """Append lines, and copy the images that they name."""
        for row in rows if images and name in ("left", "right") else ():
            shutil.copy(self.source / row.split(",")[0], self.folder / row.split(",")[0])
        with (self.folder / f"{name}.csv").open("a") as file:
            file.write("".join(row + "\n" for row in rows))

    def drive(self, output: Path, *, longest_lag_s: float = 1e6) -> LiveDrive:
        """Return what `linework live` follows the folder with; a later one continues as after a kill."""
        survey = open_survey([self.folder])
        work = self.folder / ".linework"
        work.mkdir(exist_ok=True)
        with live_folder(work, output) as folder:
            kept = KeptDrive(folder, survey.root)
        return LiveDrive(
            survey, output, kept, longest_lag_s=longest_lag_s, report=self.lines.append,
            monotonic=lambda: self.now_s,
        )  # fmt: skip

    def go(self, drive: LiveDrive, until_s: float, *, step_s: float = 0.2) -> None:
        """Fill the folder and follow it, up to a time."""
        while self.time_s < until_s - 1e-9:
            self.fill(self.time_s + step_s)
            self.settle(drive)

    def settle(self, drive: LiveDrive) -> None:
        """Let it do what is due now."""
        while drive.step(self.now_s):
            pass

    def wait(self, drive: LiveDrive, seconds: float) -> None:
        """Let time pass in which nothing arrives."""
        for _ in range(round(seconds / 0.25)):
            self.time_s += 0.25
            self.settle(drive)


def stripe_offsets(lines) -> list[float]:
    """Return the offset of each line to the left of the road's axis. [m]."""
    return [float(np.median(line.xyz[:, 1]) - ORIGIN[1]) for line in lines]


SOLID = [stripe[0] for stripe in STRIPES if stripe[2] == 0.0]
