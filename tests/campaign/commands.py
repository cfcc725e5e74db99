"""The commands that write, each on a small survey, and how it is judged what a disturbed one left."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tests.campaign.ledger import Trial
from tests.campaign.warm import Ended, Warm
from tests.scenes.image_folders import stereo_folder

#: The longest message: what a terminal shows on four lines. The folder of the scene does not count. [characters]
LONGEST_MESSAGE = 300
#: A file of somebody else beside every output, and what it holds.
FOREIGN = ("notes.txt", b"not made by linework\n")
#: Made anew in every run: times and durations are in them.
_OF_THE_RUN = re.compile(r"(^|[/.])run\.json$")
#: Stay beside outputs while they are written, and hold nothing.
_LOCK = re.compile(r"\.lock$")


@dataclass(frozen=True)
class Command:
    """A command that writes.

    Parameters
    ----------
    name
        In the table.
    arguments
        Of `linework`, with {scene} for the folder of inputs and {out} for that of outputs.
    again
        Options with which it is run again after it was stopped.
    weight
        How many trials it gets, against one of `extract`: less where it takes long.
    """

    name: str
    arguments: tuple[str, ...]
    again: tuple[str, ...] = ()
    weight: float = 1.0

    def words(self, scene: Path, out: Path, *more: str) -> list[str]:
        """Return its arguments for these folders."""
        return [word.format(scene=scene, out=out) for word in (*self.arguments, *more)]


_WORK = ("--work", "{out}/work", "--quiet")
COMMANDS = {
    command.name: command
    for command in (
        Command(
            "extract", ("extract", "{scene}/drive", "-o", "{out}/lines.gpkg", "--workers", "1", *_WORK), ("--resume",)
        ),
        Command(
            "extract, 2 workers", ("extract", "{scene}/drive", "-o", "{out}/lines.geojson", "--workers", "2",
            "--config", "{scene}/tiles.toml", *_WORK), ("--resume",), 0.4,
        ),
        Command("convert to GeoPackage", ("convert", "{scene}/drive/truth.gpkg", "{out}/lines.gpkg")),
        Command("convert to GeoJSON", ("convert", "{scene}/drive/truth.gpkg", "{out}/lines.geojson")),
        Command("convert to FlatGeobuf", ("convert", "{scene}/drive/truth.gpkg", "{out}/lines.fgb")),
        Command("convert to KML", ("convert", "{scene}/drive/truth.gpkg", "{out}/lines.kml")),
        Command("convert to DXF", ("convert", "{scene}/drive/truth.gpkg", "{out}/lines.dxf")),
        Command("locate", ("locate", "{scene}/drive", "-o", "{out}/path.csv", "--quiet")),
        Command(
            "simulate", ("simulate", "-o", "{out}/survey", "--length-m", "40", "--points-per-m", "100", "--no-images",
            "--quiet"),
        ),
        Command("trace", ("trace", "{scene}/drive", "-o", "{out}/line.gpkg", "--at", "{{at}}", *_WORK)),
        Command("photolog", ("photolog", "{scene}/photos", "-o", "{out}/page.html", *_WORK)),
        Command(
            "evaluate with a picture",
            ("evaluate", "{scene}/lines.gpkg", "{scene}/drive/truth.gpkg", "--picture", "{out}/scores.png"), (), 0.4,
        ),
        Command(
            "extract with a report", ("extract", "{scene}/drive", "-o", "{out}/lines.gpkg", "--report",
            "{out}/report.html", "--workers", "1", *_WORK), ("--resume",), 0.2,
        ),
        Command("raster", ("raster", "{scene}/drive", "-o", "{out}/images", "--cell-m", "1", *_WORK), (), 0.2),
        Command("demo", ("demo", "{out}/demo", "--quiet"), (), 0.05),
    )
}  # fmt: skip


@dataclass
class Scene:
    """The inputs of all commands, and what each command makes of them when nothing disturbs it.

    Parameters
    ----------
    folder
        Holds the inputs.
    expected
        Per command: SHA-256 of each file that is the same in two runs, "" for one that only has to be there.
    seconds
        Per command, how long it takes. [s]
    """

    folder: Path
    at: str = ""
    expected: dict[str, dict[str, str]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def words(self, command: Command, out: Path, *more: str) -> list[str]:
        """Return the arguments of a command."""
        return [word.replace("{at}", self.at) for word in command.words(self.folder, out, *more)]

    def learn(self, command: Command, warm: Warm, folder: Path) -> None:
        """Run a command twice without a fault and keep what both came to."""
        if command.name in self.expected:
            return
        found = []
        for name in ("first", "second"):
            out = fresh(folder / f"undisturbed-{name}")
            ended = warm.run(self.words(command, out), limit_s=600.0)
            assert ended.code == 0, f"{command.name}: {ended}"
            self.seconds[command.name] = ended.seconds
            found.append(hashes(out))
            shutil.rmtree(out)
        first, second = found
        assert set(first) == set(second), f"{command.name}: {set(first) ^ set(second)}"
        self.expected[command.name] = {
            name: value if second[name] == value and not _OF_THE_RUN.search(name) else ""
            for name, value in first.items()
        }


def make_scene(folder: Path) -> Scene:
    """Return a scene whose inputs are in a folder, written where they are not there yet."""
    from linework.files.trajectories.read import write_trajectory
    from linework.files.vectors.read_write import read_lines
    from linework.model.trajectory import Trajectory
    from linework.simulation.folder import write_survey_folder
    from linework.simulation.simulate import simulate_survey

    done = folder / "made"
    if not done.exists():
        shutil.rmtree(folder, ignore_errors=True)
        write_survey_folder(simulate_survey("bends", 612, 40.0, points_per_m=300), folder / "drive")
        (folder / "tiles.toml").write_text(
            "[tiling]\ncore_m = 64.0\nhigh_core_m = 64.0\nmax_points = 10000\n", encoding="utf-8"
        )
        extract = [
            "extract",
            folder / "drive",
            "-o",
            folder / "lines.gpkg",
            "--quiet",
            "--work",
            folder / "work",
        ]
        subprocess.run([sys.executable, "-m", "linework", *map(str, extract)], check=True)
        times = [round(0.05 + 0.1 * i, 3) for i in range(8)]
        stereo_folder(folder / "photos", times, more='[trajectory]\nfile = "trajectory.csv"\n')
        time = np.arange(11) / 10.0
        xyz = np.stack([500_000.0 + 10.0 * time, np.full(11, 5_400_000.0), np.full(11, 100.0)], axis=1)
        write_trajectory(
            Trajectory(time, xyz, np.tile([0.0, 0.0, 90.0], (11, 1))), folder / "photos" / "trajectory.csv"
        )
        done.touch()
    rail = next(line for line in read_lines(folder / "lines.gpkg") if line.kind == "guardrail")
    east, north = rail.xyz[len(rail.xyz) // 2, :2]
    return Scene(folder, at=f"{east:.3f},{north:.3f}")


def fresh(out: Path) -> Path:
    """Return an output folder that holds nothing but a file of somebody else."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    (out / FOREIGN[0]).write_bytes(FOREIGN[1])
    return out


def files_of(out: Path) -> Iterator[Path]:
    """Yield the files of outputs: all in a folder but those of the work folder and locks."""
    for path in sorted(out.rglob("*")):
        parts = path.relative_to(out).parts
        if path.is_file() and parts[0] != "work" and ".linework" not in parts and not _LOCK.search(path.name):
            yield path


def hashes(out: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of outputs by its name."""
    return {
        path.relative_to(out).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files_of(out)
        if path.name != FOREIGN[0]
    }


def is_part(name: str) -> bool:
    """Return whether a file is one that is being written, beside its final name."""
    return any(part.startswith(".") and ".part" in part for part in name.split("/"))


def whole(name: str, path: Path) -> bool:
    """Return whether a file that differs from run to run can be read."""
    if name.endswith(".json"):
        try:
            json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            return False
    return path.stat().st_size > 0


def judge_files(
    trial: Trial,
    out: Path,
    expected: Mapping[str, str],
    what: str,
    *,
    ended_well: bool,
    old: Mapping[str, str] | None = None,
) -> None:
    """Blame what is at the final names and neither the right file nor the old one; and, after success, what is missing."""  # fmt: skip
    there = {name: value for name, value in hashes(out).items() if not is_part(name)}
    for name, value in there.items():
        if name not in expected:
            trial.blame("other faults", f"{what}: {name} is left over")
        elif not expected[name]:
            if not whole(name, out / name):
                trial.blame("silent losses", f"{what}: {name} is not whole")
        elif value != expected[name] and (ended_well or value != (old or {}).get(name)):
            trial.blame("silent losses", f"{what}: {name} is neither the old nor the new one")
    if ended_well:
        for name in sorted(set(expected) - set(there)):
            trial.blame("silent losses", f"{what}: success without {name}")
    foreign = out / FOREIGN[0]
    if not foreign.exists() or foreign.read_bytes() != FOREIGN[1]:
        trial.blame("silent losses", f"{what}: somebody else's file is gone")


def judge_ending(trial: Trial, ended: Ended, what: str, folder: Path) -> None:
    """Count how a command ended, and blame hangs, signals, faults of ours and messages that say too little."""
    trial.came[f"exit {ended.code}" if not ended.killed else "killed"] += 1
    if ended.killed:
        return
    if ended.hung:
        trial.blame("hangs", f"{what}: {ended.seconds:.0f} s")
    elif ended.code < 0:
        trial.blame("signals", f"{what}: signal {-ended.code}: {ended.stderr[-300:]}")
    elif ended.code in (1, 70):
        trial.blame("exit 1", f"{what}: {ended.stderr[-600:]}")
    elif ended.code in (2, 3, 4, 5, 6) and (problem := unclear(ended, folder)):
        trial.blame("unclear messages", f"{what}: {problem}")


def unclear(ended: Ended, folder: Path) -> str:
    """Return what is wrong with the message of a command that failed, "" if nothing is."""
    if "Traceback" in ended.stderr:
        return f"a traceback: {ended.stderr[-300:]}"
    if ended.code == 4:  # finished: warnings name what is missing
        return "" if "warning:" in ended.stderr else "exit 4 without a word"
    if len(ended.errors) != 1:
        return f"{len(ended.errors)} errors: {ended.stderr[-300:]}"
    line = ended.errors[0].replace(str(folder), "")
    if len(line) > LONGEST_MESSAGE:
        return f"{len(line)} characters: {line}"
    # File, what is wrong, what to do
    sentences = [s for s in re.split(r"[.?] ", line.rstrip(".")) if s]
    if ": " not in line.removeprefix("error: ") or len(sentences) < 2:
        return f"no file or no advice: {line}"
    return ""


def run_again(
    warm: Warm, scene: Scene, command: Command, out: Path, trial: Trial, what: str, *, over: bool = False
) -> None:
    """Run a command that was stopped once more, without a fault, and blame it where that does not come right."""
    expected = scene.expected[command.name]
    more = [*command.again, *(["--overwrite"] if over and "--overwrite" not in command.again else [])]
    ended = warm.run(scene.words(command, out, *more), limit_s=600.0)
    if ended.code == 6 and not over:  # it had been published already, or files of it
        there = {n: v for n, v in hashes(out).items() if not is_part(n)}
        if set(expected) <= set(there):
            trial.came["was finished"] += 1
            judge_files(trial, out, expected, f"{what}, finished before", ended_well=True)
            return
        ended = warm.run(scene.words(command, out, *command.again, "--overwrite"), limit_s=600.0)
        trial.came["again with --overwrite"] += 1
    if ended.code != 0:
        trial.blame("other faults", f"{what}: run again: exit {ended.code}: {ended.stderr[-300:]}")
        return
    judge_files(trial, out, expected, f"{what}, run again", ended_well=True)
    left = [path.relative_to(out).as_posix() for path in files_of(out)]
    for name in left:
        if is_part(name):
            trial.blame("other faults", f"{what}, run again: {name} is left")


def chosen(names: Sequence[str] | None = None) -> list[Command]:
    """Return commands by name; None: all."""
    return [COMMANDS[name] for name in (names or COMMANDS)]


Trials = Iterator[tuple[str, Callable[[], Trial]]]
