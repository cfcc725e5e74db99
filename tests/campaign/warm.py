"""Commands run as children of a process that has imported and compiled everything: a second instead of four each.

Every command is a process of its own, forked before anything but imports has happened in it, with its own group,
environment, limits and standard streams. The process that forks them is asked over its standard input, a line of JSON
for a command, and answers with a line of JSON. Command line: ``python -m tests.campaign.warm``.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: A command on a small scene takes a second: after so long it hangs. [s]
HANG_S = 120.0
#: A command that does not follow SIGTERM is killed after this. [s]
END_S = 10.0


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Parameters
    ----------
    code
        Exit code; below 0 the signal that ended it.
    hung
        It was still running after the limit.
    killed
        It was killed because that was asked for.
    """

    code: int
    seconds: float
    stdout: str
    stderr: str
    hung: bool = False
    killed: bool = False

    @property
    def errors(self) -> list[str]:
        """The lines of errors on stderr."""
        return [line for line in self.stderr.splitlines() if line.startswith("error:")]


class Warm:
    """The process that forks commands.

    Parameters
    ----------
    library
        What is loaded before everything else (LD_PRELOAD): calls that fail where the environment says so.
    """

    def __init__(self, library: Path | None = None) -> None:
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONDEVMODE": ""}
        if library is not None:
            environment["LD_PRELOAD"] = str(library)
        self._library = library
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.campaign.warm", *([str(library)] if library else [])],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1, env=environment,
        )  # fmt: skip

    def run(
        self, arguments: Sequence[object], *, environment: Mapping[str, str] | None = None, cwd: Path | None = None,
        kill_after_s: float | None = None, limit_s: float = HANG_S, file_bytes: int | None = None,
    ) -> Ended:  # fmt: skip
        """Run `linework` with these arguments.

        Parameters
        ----------
        environment
            Set beside what there is.
        kill_after_s
            The command's whole group is killed (SIGKILL) so long after its start. [s]
        file_bytes
            Limit on the size of a file (RLIMIT_FSIZE). [bytes]
        """
        assert self._process.stdin is not None and self._process.stdout is not None
        job = {
            "arguments": [str(a) for a in arguments], "environment": dict(environment or {}),
            "cwd": str(cwd) if cwd else None, "kill_after_s": kill_after_s, "limit_s": limit_s,
            "file_bytes": file_bytes,
        }  # fmt: skip
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, f"the process that forks commands ended: {self._process.wait()}"
        return Ended(**json.loads(line))

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(30)
        self._process.stdout.close()

    def __enter__(self) -> Warm:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def serve(library: str | None) -> None:
    """Fork a command for each line of stdin, and answer how it ended."""
    from linework.cli.app import main

    warm_up()
    injector = ctypes.CDLL(library) if library else None
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    for line in sys.stdin:
        job = json.loads(line)
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            start = time.monotonic()
            pid = os.fork()
            if pid == 0:
                become(job, out.fileno(), err.fileno())
                if injector is not None:
                    injector.arm_faults()
                code = 70
                with contextlib.suppress(BaseException):
                    code = main(job["arguments"])
                    # What Python does at its end, and os._exit does not
                    sys.stdout.flush()
                # So that the number of calls is written down, as at the end of a program
                if injector is not None:
                    injector.note_faults()
                os._exit(code)
            ended = watched(pid, job, start)
            texts = {}
            for name, file in (("stdout", out), ("stderr", err)):
                file.seek(0)
                texts[name] = file.read(200_000).decode("utf-8", "backslashreplace")
            print(json.dumps({**ended, **texts, "seconds": time.monotonic() - start}), file=answers)


def warm_up() -> None:
    """Import what commands import; kernels are loaded from their cache when they are first called."""
    import importlib

    names = (
        "numba", "numpy", "scipy.spatial", "scipy.optimize", "scipy.ndimage", "scipy.interpolate", "pyogrio", "laspy",
        "shapely", "pyproj", "ezdxf", "rasterio", "matplotlib.figure", "PIL.Image", "linework.runs.extract",
        "linework.simulation.folder", "linework.simulation.simulate", "linework.navigation.locate",
        "linework.evaluation.measures", "linework.tracing.trace", "linework.files.vectors.read_write",
    )  # fmt: skip
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def become(job: Mapping[str, Any], out: int, err: int) -> None:
    """Turn a forked process into that of a command: its group, streams, environment, folder and limits."""
    import resource

    os.setpgid(0, 0)
    null = os.open(os.devnull, os.O_RDONLY)
    for ours, its in ((null, 0), (out, 1), (err, 2)):
        os.dup2(ours, its)
    os.environ.update(job["environment"])
    if job["cwd"]:
        os.chdir(job["cwd"])
    if job["file_bytes"] is not None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (job["file_bytes"], job["file_bytes"]))


def watched(pid: int, job: Mapping[str, Any], start: float) -> dict[str, Any]:
    """Wait for a command, kill its group when that was asked for or it hangs, and say how it ended."""
    handle = os.pidfd_open(pid)
    try:
        kill_s, limit_s = job["kill_after_s"], job["limit_s"]
        waits_s = limit_s if kill_s is None else min(kill_s, limit_s)
        ready, _, _ = select.select([handle], [], [], max(waits_s - (time.monotonic() - start), 0.0))
        if not ready:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)
        _, status = os.waitpid(pid, 0)
        with contextlib.suppress(ProcessLookupError):  # workers that live on
            os.killpg(pid, signal.SIGKILL)
    finally:
        os.close(handle)
    return {
        "code": os.waitstatus_to_exitcode(status),
        "hung": not ready and kill_s is None,
        "killed": not ready and kill_s is not None,
    }


@contextlib.contextmanager
def warm_process(library: Path | None = None) -> Iterator[Warm]:
    """Give a process that forks commands."""
    with Warm(library) as warm:
        yield warm


if __name__ == "__main__":
    serve(sys.argv[1] if len(sys.argv) > 1 else None)
