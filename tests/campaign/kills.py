"""Commands killed at random moments and at the k-th call: is what they come to afterwards right, to the last byte?

The whole group of processes is killed (SIGKILL). A command is killed and run again until it ends, with an output of
before in its place or without one. The workbench is killed while lines are drawn: every change that it had answered
is there.
"""

from __future__ import annotations

import math
import random
import shutil
import threading
import zlib
from pathlib import Path

from tests.campaign.calls import CALLS, built_library, failing, n_calls, spread
from tests.campaign.commands import (
    COMMANDS,
    Command,
    Scene,
    Trials,
    files_of,
    fresh,
    hashes,
    is_part,
    judge_ending,
    judge_files,
    make_scene,
    run_again,
)
from tests.campaign.ledger import Step, Trial
from tests.campaign.warm import Warm

#: Kills of `extract` at random moments; others get their share by weight.
KILLS = 200
#: A command is killed so often in a row before it may end.
MOST_IN_A_ROW = 4
#: Kills at calls, per kind of call.
AT_CALLS = 40
#: Rounds of the workbench, each ended by a kill.
ROUNDS = 20
#: How long lines are drawn before a kill. [s]
LONGEST_EDITING_S = 1.5
_BATCH = 20


def trials(folder: Path, share: float) -> Trials:
    """Yield trials of kills at random moments, at calls, and of the workbench."""
    library = built_library(folder)
    scene = make_scene(folder / "scene")
    with Warm(library) as warm:
        for command in COMMANDS.values():
            if share < 0.01 and not command.name.startswith("convert to GeoJSON"):
                continue
            n = max(math.ceil(KILLS * command.weight * min(share, 1.0)), 2)
            for first in range(0, n, _BATCH):

                def at_random(command=command, first=first, n=n) -> Trial:
                    kills = min(_BATCH, n - first)
                    return killed_at_random(warm, scene, command, folder / "kills", first, kills)

                yield f"{command.name}, random {first}", at_random
        for command in COMMANDS.values():
            if command.weight < 1.0 or share < 0.01:
                continue
            for call in ("write", "fsync", "rename", "close", "mkdir"):

                def at_calls(command=command, call=call) -> Trial:
                    return killed_at_calls(warm, scene, command, folder / "kills", call, share)

                yield f"{command.name}, at {call}", at_calls
    n = max(math.ceil(ROUNDS * min(share, 1.0)), 1)
    for seed in range(n):
        yield f"serve {seed}", lambda seed=seed: killed_while_editing(folder / "kills", seed)


def killed_at_random(
    warm: Warm, scene: Scene, command: Command, folder: Path, first: int, n_kills: int
) -> Trial:
    """Kill a command at random moments until there were so many kills."""
    scene.learn(command, warm, folder)
    expected, seconds = scene.expected[command.name], scene.seconds[command.name]
    chance = random.Random(zlib.crc32(f"{command.name} {first}".encode()))
    total, kills = Trial(cases=0, figures={"seconds undisturbed": round(seconds, 2)}), 0
    while kills < n_kills:
        out = fresh(folder / "out")
        old = an_older_output(warm, scene, command, out) if chance.random() < 0.3 else {}
        what = f"{command.name}, kill {first + kills}"
        for _ in range(min(MOST_IN_A_ROW, n_kills - kills)):
            more = [*command.again, *(["--overwrite"] if old else [])]
            ended = warm.run(
                scene.words(command, out, *more), kill_after_s=chance.uniform(0.02, 1.0) * seconds
            )
            judge_ending(total, ended, what, out)
            judge_files(total, out, expected, what, ended_well=ended.code == 0, old=old)
            total.cases += 1
            kills += 1
            if not ended.killed:
                break
        run_again(warm, scene, command, out, total, what, over=bool(old))
    return total


def an_older_output(warm: Warm, scene: Scene, command: Command, out: Path) -> dict[str, str]:
    """Put other files in the place of a command's outputs; return their hashes."""
    ended = warm.run(scene.words(command, out), limit_s=600.0)
    assert ended.code == 0, ended
    shutil.rmtree(out / "work", ignore_errors=True)
    for path in files_of(out):
        if path.parent == out and path.suffix in (
            ".gpkg",
            ".geojson",
            ".html",
            ".png",
            ".csv",
            ".fgb",
            ".kml",
        ):
            path.write_bytes(path.read_bytes() + b"\n")
    return hashes(out)


def killed_at_calls(
    warm: Warm, scene: Scene, command: Command, folder: Path, call: str, share: float
) -> Trial:
    """Kill a process of a command at each call of a kind that writes."""
    assert call in CALLS
    scene.learn(command, warm, folder)
    expected = scene.expected[command.name]
    n = n_calls(warm, scene, command, folder, call)
    total = Trial(cases=0, figures={"calls": n})
    for k in spread(n, max(math.ceil(AT_CALLS * min(share, 1.0)), 2)):
        out = fresh(folder / "out")
        what = f"{command.name}, killed at {call} {k} of {n}"
        ended = warm.run(scene.words(command, out), environment=failing(call, k, "kill", 0, out))
        total.cases += 1
        # The process that made the call is gone: the command itself, or one that works for it
        if ended.code == -9:
            total.came["killed"] += 1
        else:
            judge_ending(total, ended, what, out)
        judge_files(total, out, expected, what, ended_well=ended.code == 0)
        if ended.code != 0 or any(is_part(path.name) for path in files_of(out)):
            run_again(warm, scene, command, out, total, what)
    return total


def killed_while_editing(folder: Path, seed: int) -> Trial:
    """Draw lines in the workbench until it is killed; every line that was answered is in the file."""
    from tests.conftest import CRS, road_points
    from tests.workbench.safety.test_kill import edit_until_it_dies
    from tests.workbench.serve_process import served_survey

    from linework.files.las.write import write_las
    from linework.files.vectors.read_write import read_lines

    survey = folder / "served"
    if seed == 0 or not (survey / "a.laz").exists():
        shutil.rmtree(survey, ignore_errors=True)
        survey.mkdir(parents=True)
        write_las(road_points(), survey / "a.laz", crs=CRS)
    lines = survey / "lines.gpkg"
    before = {int(line.xyz[0, 2]) for line in read_lines(lines)} if lines.exists() else set()
    chance = random.Random(seed)
    trial = Trial()
    with served_survey(survey) as served:
        killing = threading.Timer(chance.uniform(0.3, LONGEST_EDITING_S), served.process.kill)
        killing.start()
        answered = edit_until_it_dies(served, first=max(before, default=0) + 1)
        killing.join()
        served.process.wait(10)
    held = [int(line.xyz[0, 2]) for line in read_lines(lines)]
    trial.came["edits answered"] += len(answered)
    for number in sorted((before | set(answered)) - set(held)):
        trial.blame("silent losses", f"serve {seed}: line {number} was answered and is gone")
    if len(held) != len(set(held)) or len(held) > len(before) + len(answered) + 1:
        trial.blame(
            "other faults", f"serve {seed}: {len(held)} lines, {len(before)} before, {len(answered)} drawn"
        )
    return trial


STEP = Step("kills", "commands killed and run again", trials)
