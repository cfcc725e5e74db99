"""Every call that writes fails once, from there on, or in part: is a command that ends well always right?

Each k-th call of a kind fails, in each process that makes so many, with ENOSPC and with EIO. After each fault the
command is run again without it, and must come to the right files.
"""

from __future__ import annotations

import errno
import math
import os
import subprocess
from pathlib import Path

from tests.campaign.commands import (
    COMMANDS,
    Command,
    Scene,
    Trials,
    fresh,
    hashes,
    judge_ending,
    judge_files,
    make_scene,
    run_again,
)
from tests.campaign.ledger import Step, Trial
from tests.campaign.warm import Warm

ERRORS = {"ENOSPC": errno.ENOSPC, "EIO": errno.EIO, "ENOMEM": errno.ENOMEM}
#: Kinds of calls, and how each fails.
CALLS = {
    "write": ("once", "always", "short"),
    "fsync": ("once", "always"),
    "rename": ("once", "always"),
    "open": ("once",),
    "truncate": ("once",),
    "close": ("once",),
    "mkdir": ("once",),
    "memory": ("once", "always"),
}
#: Errors that only these calls give in practice.
SOLE = {"mkdir": ("ENOSPC",), "memory": ("ENOMEM",)}
#: Left out: their writes are those of `extract`, and they take tens of seconds each.
_LONG = ("demo", "raster", "extract with a report", "extract, 2 workers")
#: Calls of a command that are tried with each kind of fault; where it makes more, they are spread evenly.
MOST = 60


def built_library(folder: Path) -> Path:
    """Return the library of failing calls, compiled into a folder."""
    source, library = Path(__file__).with_name("failing_calls.c"), folder / "failing_calls.so"
    folder.mkdir(parents=True, exist_ok=True)
    if not library.exists() or library.stat().st_mtime < source.stat().st_mtime:
        part = library.with_suffix(f".{os.getpid()}.so")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", part, source, "-ldl"], check=True)
        part.replace(library)
    return library


def failing(
    call: str, k: int, how: str, error: int, under: Path, count: Path | None = None
) -> dict[str, str]:
    """Return the environment in which the k-th call of a kind fails."""
    found = {
        "FAIL_CALL": call, "FAIL_AT": str(k), "FAIL_HOW": how, "FAIL_WITH": str(error), "FAIL_UNDER": f"{under}/",
    }  # fmt: skip
    return found | ({} if count is None else {"FAIL_COUNT": str(count)})


def n_calls(warm: Warm, scene: Scene, command: Command, folder: Path, call: str) -> int:
    """Return how often the busiest process of a command makes a call."""
    out, count = fresh(folder / "counted"), folder / "count.txt"
    count.unlink(missing_ok=True)
    ended = warm.run(scene.words(command, out), environment=failing(call, 0, "once", 0, out, count))
    assert ended.code == 0, f"{command.name}: {ended}"
    return max(int(line.split()[1]) for line in count.read_text(encoding="utf-8").splitlines())


def spread(n: int, most: int) -> list[int]:
    """Return at most so many of 1 to n, spread evenly, the first and the last among them.

    >>> spread(3, 10), spread(100, 4)
    ([1, 2, 3], [1, 34, 67, 100])
    """
    if n <= most:
        return list(range(1, n + 1))
    return sorted({round(1 + i * (n - 1) / (most - 1)) for i in range(most)})


def trials(folder: Path, share: float) -> Trials:
    """Yield a trial per command, kind of call, way to fail and error."""
    library = built_library(folder)
    scene = make_scene(folder / "scene")
    with Warm(library) as warm:
        for command in COMMANDS.values():
            if command.name in _LONG or (share < 0.01 and not command.name.startswith("convert to Geo")):
                continue
            for call, ways in CALLS.items():
                for how in ways:
                    for error in SOLE.get(call, ("ENOSPC", "EIO")):
                        if how == "short" and error == "EIO":
                            continue

                        def trial(command=command, call=call, how=how, error=error) -> Trial:
                            return one_kind(warm, scene, command, folder / "calls", call, how, error, share)

                        yield f"{command.name}, {call} {how} {error}", trial


def one_kind(
    warm: Warm, scene: Scene, command: Command, folder: Path, call: str, how: str, error: str, share: float
) -> Trial:
    """Try a way to fail at each call of a kind."""
    scene.learn(command, warm, folder)
    expected = scene.expected[command.name]
    n = n_calls(warm, scene, command, folder, call)
    tried = spread(n, max(math.ceil(MOST * min(1.0, share)), 2))
    total = Trial(cases=0, figures={"calls": n})
    for k in tried:
        total.cases += 1
        out = fresh(folder / "out")
        what = f"{command.name}, {call} {k} of {n} {how} {error}"
        ended = warm.run(scene.words(command, out), environment=failing(call, k, how, ERRORS[error], out))
        judge_ending(total, ended, what, out)
        judge_files(total, out, expected, what, ended_well=ended.code == 0)
        if ended.code != 0 or set(hashes(out)) != set(expected):
            run_again(warm, scene, command, out, total, what)
    return total


STEP = Step("calls", "calls that write, made to fail one by one", trials)
