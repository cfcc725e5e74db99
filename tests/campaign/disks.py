"""Full disks of many sizes, from a tenth of what a command needs to a little more than all of it.

Disks are made with mount (tmpfs) where that is allowed; elsewhere the size of files is limited instead, which the
system answers in the same way (EFBIG for ENOSPC). The trial says which it was.
"""

from __future__ import annotations

import contextlib
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path

from tests.campaign.commands import (
    COMMANDS,
    Command,
    Scene,
    Trials,
    fresh,
    judge_ending,
    judge_files,
    make_scene,
    run_again,
)
from tests.campaign.ledger import Step, Trial
from tests.campaign.warm import Warm

#: Sizes per command.
SIZES = 20
#: Largest size, against what is needed.
_MORE = 1.1
_LONG = ("demo", "raster", "extract with a report", "extract, 2 workers")


def trials(folder: Path, share: float) -> Trials:
    """Yield a trial per command."""
    scene = make_scene(folder / "scene")
    n = max(math.ceil(SIZES * min(share, 1.0)), 2)
    with Warm() as warm:
        for command in COMMANDS.values():
            if command.name in _LONG or (share < 0.01 and command.name != "convert to GeoJSON"):
                continue
            yield command.name, lambda command=command: full_disks(warm, scene, command, folder / "disks", n)


def needed_bytes(out: Path) -> int:
    """Return what a command has written, work folder included."""
    return sum(-(-path.stat().st_size // 4096) * 4096 for path in out.rglob("*") if path.is_file())


def full_disks(warm: Warm, scene: Scene, command: Command, folder: Path, n: int) -> Trial:
    """Run a command on disks that are too small, make them large, and run it again."""
    # As deep in the tree as outputs are later: pages hold relative links
    scene.learn(command, warm, folder / "disk")
    expected = scene.expected[command.name]
    out = fresh(folder / "measured")
    assert warm.run(scene.words(command, out)).code == 0
    needed = needed_bytes(out)
    largest = max(path.stat().st_size for path in out.rglob("*") if path.is_file())
    total = Trial(cases=0, figures={"bytes needed": needed})
    for i in range(n):
        share = 0.1 + (_MORE - 0.1) * i / max(n - 1, 1)
        what = f"{command.name}, {share:.0%} of {needed:,} bytes"
        total.cases += 1
        with disk(folder / "disk", int(share * needed)) as enlarge:
            is_mounted = enlarge is not None
            out = fresh(folder / "disk" / "out")
            file_bytes = None if is_mounted else int(share * largest)
            ended = warm.run(scene.words(command, out), file_bytes=file_bytes)
            total.came["tmpfs" if is_mounted else "limit on the size of files"] += 1
            judge_ending(total, ended, what, out)
            judge_files(total, out, expected, what, ended_well=ended.code == 0)
            if ended.code not in (0, 5, 4):
                total.blame("unclear messages", f"{what}: exit {ended.code}, not 5: {ended.stderr[-300:]}")
            if ended.code == 5 and not any(w in ended.stderr for w in ("space", "too large", "needs")):
                total.blame("unclear messages", f"{what}: a full disk is not said: {ended.stderr[-300:]}")
            if enlarge is not None:
                subprocess.run(enlarge, check=True)
            run_again(warm, scene, command, out, total, what)
    return total


@contextlib.contextmanager
def disk(place: Path, n_bytes: int) -> Iterator[list[str] | None]:
    """Give a small disk at a place, as the command that enlarges it; None where none can be made."""
    place.mkdir(parents=True, exist_ok=True)
    # tmpfs counts whole pages
    size = max(n_bytes // 4096, 4) * 4096
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)], check=False, capture_output=True
    )
    if mounted.returncode != 0:
        yield None
        return
    try:
        yield ["mount", "-o", "remount,size=1g", str(place)]
    finally:
        subprocess.run(["umount", str(place)], check=True)


STEP = Step("disks", "full disks", trials)
