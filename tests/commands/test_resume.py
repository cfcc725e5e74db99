"""`linework extract`, killed and resumed; and `linework clean`."""

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.scenes.effort import THOROUGH

from linework.files.vectors.read_write import read_lines
from linework.simulation.folder import write_survey_folder
from linework.simulation.simulate import simulate_survey

#: Many tiles, so that there is something to resume.
SETTINGS = "[tiling]\ncore_m = 64.0\nhigh_core_m = 64.0\nmax_points = 10000\n"


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("resume") / "survey"
    write_survey_folder(simulate_survey("bends", 612, 150.0, points_per_m=800), folder)
    (folder / "run.toml").write_text(SETTINGS)
    return folder


def command(survey, out, *more):
    return [
        sys.executable, "-m", "linework", "extract", str(survey), "-o", str(out / "lines.gpkg"),
        "--config", str(survey / "run.toml"), "--work", str(out / "work"), "--quiet", *more,
    ]  # fmt: skip


@pytest.fixture
def run(linework):
    """Return a function that runs the command to its end in this process: one that is not killed needs none of its own."""

    def run(survey, out, *more):
        return linework(*command(survey, out, *more)[3:], "--workers", 1)

    return run


def sha(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def undisturbed(survey, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed")
    start = time.monotonic()
    subprocess.run(command(survey, out), check=True, capture_output=True)
    return out / "lines.gpkg", time.monotonic() - start


# Each seed is so many kills, and a run more
@pytest.mark.parametrize("seed", range(3 if THOROUGH else 1))
def test_a_killed_run_goes_on_to_the_same_bytes(survey, undisturbed, run, tmp_path, seed):
    expected, seconds = undisturbed
    chance, n_killed = random.Random(seed), 0
    for _ in range(4 if THOROUGH else 2):
        with subprocess.Popen(
            command(survey, tmp_path, "--resume"), start_new_session=True, stderr=subprocess.PIPE, text=True
        ) as process:
            try:
                process.wait(chance.uniform(0.2, 0.9) * seconds)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                n_killed += 1
                if (tmp_path / "lines.gpkg").exists():
                    assert sha(tmp_path / "lines.gpkg") == sha(expected)
            else:
                # Quicker than the first: begun anew, and killed earlier
                assert process.returncode == 0
                (tmp_path / "lines.gpkg").unlink()
                (tmp_path / "run.json").unlink()
                seconds /= 2.0
    assert n_killed > 0
    last = run(survey, tmp_path, "--resume")
    assert last.code == 0, last.stderr
    assert sha(tmp_path / "lines.gpkg") == sha(expected)
    assert not list(tmp_path.glob(".*.part*"))
    assert not list((tmp_path / "work" / "runs").iterdir())


def test_a_finished_run_resumed_is_finished(survey, undisturbed, run):
    output, _ = undisturbed
    before = sha(output), (output.parent / "run.json").read_bytes()
    again = run(survey, output.parent, "--resume", "--json")
    assert again.code == 0, again.stderr
    assert json.loads(again.stdout) == json.loads(before[1])
    assert (sha(output), (output.parent / "run.json").read_bytes()) == before


def test_an_output_of_another_run_is_not_replaced_by_resuming(survey, run, tmp_path):
    (tmp_path / "lines.gpkg").write_bytes(b"mine")
    refused = run(survey, tmp_path, "--resume")
    assert refused.code == 6
    assert refused.stderr.startswith(f"error: {tmp_path / 'lines.gpkg'}: output exists already")
    assert (tmp_path / "lines.gpkg").read_bytes() == b"mine"


def stopped_in_the_middle(survey, out):
    """Kill a run when at least one tile is done and not all are."""
    with subprocess.Popen(command(survey, out), start_new_session=True, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            if len(list(out.glob("work/runs/*/tiles/*.arrays"))) >= 2:
                os.killpg(process.pid, signal.SIGKILL)
            time.sleep(0.01)
    (tiles,) = out.glob("work/runs/*/tiles")
    return sorted(tiles.glob("*.arrays"))


def test_other_settings_are_refused_with_the_difference(survey, run, tmp_path):
    stopped_in_the_middle(survey, tmp_path)
    (tmp_path / "run.toml").write_text(SETTINGS + "[radon]\ncell_m = 0.25\n")
    refused = run(survey, tmp_path, "--resume", "--config", str(tmp_path / "run.toml"))
    assert refused.code == 2
    assert "begun with settings.radon.cell_m = 0.2, now it is 0.25" in refused.stderr
    anew = run(survey, tmp_path, "--config", str(tmp_path / "run.toml"))
    assert anew.code == 0, anew.stderr


def test_tiles_that_were_altered_or_lost_are_done_again(survey, undisturbed, run, tmp_path):
    # The kill may come while a tile is being written, whose file is empty then
    altered, lost, *_ = sorted(stopped_in_the_middle(survey, tmp_path), key=lambda tile: -tile.stat().st_size)
    data = bytearray(altered.read_bytes())
    data[len(data) // 2] ^= 1
    altered.write_bytes(data)
    lost.unlink()
    resumed = run(survey, tmp_path, "--resume")
    assert resumed.code == 0, resumed.stderr
    assert sha(tmp_path / "lines.gpkg") == sha(undisturbed[0])


def test_an_interrupted_run_ends_soon_and_leaves_no_process(survey, undisturbed, run, tmp_path):
    for share in (0.6, 0.4, 0.2):  # the run that was timed may have been slowed down by others
        with subprocess.Popen(command(survey, tmp_path), stderr=subprocess.PIPE, text=True) as process:
            time.sleep(share * undisturbed[1])
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=300)
        if process.returncode != 0:
            break
        for path in filter(Path.is_file, tmp_path.iterdir()):
            path.unlink()
    assert process.returncode == 130
    assert said.splitlines()[-1].startswith("interrupted")
    assert not (tmp_path / "lines.gpkg").exists()
    resumed = run(survey, tmp_path, "--resume")
    assert resumed.code == 0, resumed.stderr
    assert sha(tmp_path / "lines.gpkg") == sha(undisturbed[0])


def test_clean_frees_what_can_be_made_anew(survey, undisturbed, tmp_path, linework):
    shutil.copytree(survey, tmp_path / "survey")
    assert (
        linework("extract", tmp_path / "survey", "-o", tmp_path / "l.geojson", "--features", "cable").code
        == 0
    )
    assert (tmp_path / "survey" / ".linework" / "stores").is_dir()
    cleaned = linework("clean", tmp_path / "survey")
    assert cleaned.code == 0
    assert "MB freed" in cleaned.stdout
    assert not (tmp_path / "survey" / ".linework").exists()
    assert linework("clean", tmp_path / "survey").stdout == "nothing to delete\n"
    assert len(read_lines(undisturbed[0])) > 0
    np.testing.assert_array_equal(
        sorted(p.name for p in tmp_path.iterdir()), ["l.geojson", "run.json", "survey"]
    )
