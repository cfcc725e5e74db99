"""A few trials of each long step of the campaign, so that the steps themselves do not break unseen."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from tests.campaign import bounds, calls, commands, disks, kills, mutations
from tests.campaign.calls import built_library
from tests.campaign.commands import COMMANDS, judge_ending, judge_files, unclear
from tests.campaign.ledger import Ledger, Trial
from tests.campaign.mutants.readers import NAMES
from tests.campaign.warm import Ended, Warm

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("cc") is None, reason="failing calls need Linux and a C compiler"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("campaign")


#: Share of a step's trials, which of them, and how many cases they are at least.
@pytest.mark.parametrize(
    ("step", "share", "keys", "least"),
    [
        (mutations.STEP, 0.004, tuple(f"{name} 0" for name in NAMES), 3 * len(NAMES)),
        (calls.STEP, 0.005, tuple(f"convert to GeoJSON, {call} once ENOSPC" for call in ("write", "fsync", "rename")), 4),
        (disks.STEP, 0.005, ("convert to GeoJSON",), 2),
        (kills.STEP, 0.005, ("convert to GeoJSON, random 0",), 2),
        (bounds.STEP, 0.005, ("info: header with 4e9 points (las)",), 1),
    ],
    ids=lambda value: getattr(value, "name", None),
)  # fmt: skip
def test_a_few_trials_find_nothing_wrong(folder, step, share, keys, least):
    def some(place: Path, part: float) -> Iterator[tuple[str, Callable[[], Trial]]]:
        with contextlib.closing(step.trials(place, part)) as trials:
            yield from ((key, trial) for key, trial in trials if key in keys)

    chosen = replace(step, trials=some)
    found = Ledger(folder / "ledger.jsonl").run(chosen, folder, share)
    assert found.offenders == []
    assert found.cases >= least


def test_a_call_that_fails_is_noticed_by_the_injector(folder):
    scene = commands.make_scene(folder / "scene")
    command = COMMANDS["convert to GeoJSON"]
    with Warm(built_library(folder)) as warm:
        scene.learn(command, warm, folder)
        out = commands.fresh(folder / "noticed")
        for call in ("write", "fsync", "rename", "open"):
            n = calls.n_calls(warm, scene, command, folder, call)
            assert n >= 1, call
            ended = warm.run(scene.words(command, out), environment=calls.failing(call, 1, "once", 28, out))
            assert ended.code == 5, (call, ended)
            assert "no space" in ended.stderr.lower()
        killed = warm.run(scene.words(command, out), environment=calls.failing("rename", 1, "kill", 0, out))
        assert killed.code == -9
        late = warm.run(scene.words(command, out), environment=calls.failing("rename", 99, "once", 28, out))
        assert late.code == 0
        hung = warm.run(scene.words(command, out, "--overwrite"), limit_s=0.01)
        assert hung.hung


def test_what_is_wrong_is_seen(tmp_path):
    """A judge that sees nothing would make every step pass."""
    out = commands.fresh(tmp_path / "out")
    expected = {"a.csv": commands.hashlib.sha256(b"right").hexdigest(), "run.json": ""}
    (out / "a.csv").write_bytes(b"half")
    (out / "run.json").write_text("{")
    (out / "b.csv").write_bytes(b"")
    trial = Trial()
    judge_files(trial, out, expected, "x", ended_well=True)
    assert trial.wrong == {"silent losses": 2, "other faults": 1}
    (out / "a.csv").unlink()
    (out / commands.FOREIGN[0]).unlink()
    trial = Trial()
    judge_files(trial, out, {"a.csv": expected["a.csv"]}, "x", ended_well=True)
    assert trial.wrong["silent losses"] == 2
    for ended, kind in (
        (Ended(-11, 1.0, "", ""), "signals"),
        (Ended(1, 1.0, "", "error: linework: KeyError"), "exit 1"),
        (Ended(-9, 1.0, "", "", hung=True), "hangs"),
        (Ended(3, 1.0, "", "error: a.laz: wrong."), "unclear messages"),
    ):
        trial = Trial()
        judge_ending(trial, ended, "x", out)
        assert trial.wrong == {kind: 1}
    assert unclear(Ended(3, 1.0, "", "error: a.laz: empty file. Copy it again.\n"), out) == ""
    assert unclear(Ended(3, 1.0, "", f"error: a.laz: {'x' * 300}. Copy it again.\n"), out)
    assert unclear(Ended(3, 1.0, "", "Traceback\nerror: a.laz: empty file. Copy it again.\n"), out)
