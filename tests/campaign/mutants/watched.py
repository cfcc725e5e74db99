"""A process that reads damaged files one after the other, ended and begun anew where it hangs or dies.

Command line, with the folder of its files: ``python -m tests.campaign.mutants.watched FOLDER``; jobs come as lines of
JSON on stdin. ``python -m tests.campaign.mutants.watched --keep FORMAT SEED FILE`` writes the damaged file of a seed.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

from tests.campaign.commands import LONGEST_MESSAGE

#: Reading a small file may take no longer; the process is ended after three times as long without an answer. [s]
LONGEST_S = 10.0
#: Beyond this, a file of a megabyte at most has taken too much memory. [MB]
MOST_MB = 600.0
_NO_ANSWER_S = 3 * LONGEST_S
#: Imports and making the sound files take a while on a loaded machine. [s]
_START_S = 300.0


class Watched:
    """The process, as its parent sees it.

    Parameters
    ----------
    folder
        For its files.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process: subprocess.Popen[str] | None = None

    def ask(self, job: dict[str, Any]) -> dict[str, Any]:
        """Return what came of one job: {"came": ..., "wrong": kind or "", "said": ...}."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.campaign.mutants.watched", str(self.folder)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1,
                env={**os.environ, "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
            assert self._line(_START_S), "the reading process does not start"
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        start = time.perf_counter()
        line = self._line(_NO_ANSWER_S)
        if line:
            return {**job, **json.loads(line)}
        hung = self.process.poll() is None and time.perf_counter() - start >= _NO_ANSWER_S
        self.process.kill()
        code = self.process.wait()
        self.process = None
        came = "no answer" if hung else f"signal {-code}"
        return {
            **job,
            "came": came,
            "wrong": "hangs" if hung else "signals",
            "said": "",
            "ms": 0.0,
            "mb": 0.0,
        }

    def _line(self, timeout_s: float) -> str:
        assert self.process is not None and self.process.stdout is not None
        ready, _, _ = select.select([self.process.stdout], [], [], timeout_s)
        return self.process.stdout.readline() if ready else ""

    def end(self) -> None:
        """End the process."""
        if self.process is not None:
            assert self.process.stdin is not None and self.process.stdout is not None
            self.process.stdin.close()
            self.process.wait(60)
            self.process.stdout.close()
            self.process = None


def work(folder: Path) -> None:
    """Read jobs from stdin, one line each, and say what came of them."""
    from tests.campaign.mutants.readers import Formats

    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    own = folder / f"worker{os.getpid()}"
    own.mkdir(parents=True, exist_ok=True)
    with Formats(own) as formats:
        print("ready", file=answers)
        for line in sys.stdin:
            job = json.loads(line)
            if "file" in job:
                path, done = Path(job["file"]), ""
            else:
                path, done = formats.damaged(job["format"], job["seed"])
            before = reset_peaks_mb()
            start = time.perf_counter()
            came, wrong, said = judged(formats, job["format"], path)
            ms = 1e3 * (time.perf_counter() - start)
            mb = sum(peaks_mb().values()) - sum(before.values())
            if not wrong and ms > 1e3 * LONGEST_S:
                wrong, said = "hangs", f"{ms / 1e3:.0f} s: {said}"
            if not wrong and mb > MOST_MB:
                wrong, said = "other faults", f"{mb:.0f} MB: {said}"
            print(
                json.dumps({"came": came, "wrong": wrong, "said": said, "done": done, "ms": ms, "mb": mb}),
                file=answers,
            )


def judged(formats: Any, name: str, path: Path) -> tuple[str, str, str]:
    """Return (what came of reading a file, the kind of wrong or "", what was said)."""
    from linework.cli.failures import failure_of
    from linework.errors import LineworkError

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            came, said = formats.read(name, path)
        except LineworkError as error:
            text = str(error).replace(str(path.parent), "")
            if "the decoder" in text:
                return "the decoder died", "signals", text
            problem = unclear(text, error.advice, path)
            return (
                f"refused ({type(error).__name__})",
                "unclear messages" if problem else "",
                f"{problem}{text}",
            )
        except BaseException as error:
            failure = failure_of(error)
            wrong = "exit 1" if failure.exit_code == 1 else "other faults"
            return f"{type(error).__name__}", wrong, failure.line[:400]
    said = " | ".join([said, *(str(one.message) for one in caught)])
    if came == "SILENT LOSS":
        return came, "silent losses", said[:400]
    if came == "fewer":
        return (
            ("read in part", "", said[:200])
            if caught or "|" in said[3:]
            else (came, "silent losses", said[:400])
        )
    return "read, warned" if caught else came, "", said[:200]


def unclear(text: str, advice: str, path: Path) -> str:
    """Return what is wrong with a message, "" if nothing is."""
    if "\n" in text:
        return "more than one line: "
    if len(text) > LONGEST_MESSAGE:
        return f"{len(text)} characters: "
    # The parts of a Shapefile go by the name of the first; a survey may go by its folder
    if path.stem not in text and path.parent.name not in text:
        return "does not name the file: "
    return "" if advice and text.endswith((".", "?", "'")) else "without advice: "


def processes() -> list[int]:
    """Return this process and those it started."""
    own = os.getpid()
    return [own, *map(int, Path(f"/proc/{own}/task/{own}/children").read_text().split())]


def reset_peaks_mb() -> dict[int, float]:
    """Forget the highest memory so far, and return what is in use."""
    for process in processes():
        Path(f"/proc/{process}/clear_refs").write_text("5")
    return peaks_mb()


def peaks_mb() -> dict[int, float]:
    """Return the highest memory of this process and those it started."""
    found = {}
    for process in processes():
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        found[process] = sum(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
    return found


def keep(name: str, seed: int, target: Path) -> None:
    """Write the damaged file of a seed."""
    import tempfile

    from tests.campaign.mutants.readers import Formats

    with tempfile.TemporaryDirectory(prefix="linework-mutant-") as folder, Formats(Path(folder)) as formats:
        path, done = formats.damaged(name, seed)
        target.write_bytes(path.read_bytes())
        print(f"{name} {seed}: {done}")


if __name__ == "__main__":
    if sys.argv[1] == "--keep":
        keep(sys.argv[2], int(sys.argv[3]), Path(sys.argv[4]))
    else:
        work(Path(sys.argv[1]))
