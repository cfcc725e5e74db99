"""The executor of a run on a Dask cluster, and what its workers must have in common with this process."""

from __future__ import annotations

import contextlib
import errno
import os
import platform
import tempfile
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from linework.errors import MachineError, UsageError, argument
from linework.files.output.locks import hold_lock
from linework.processes.system import usable_cores
from linework.runs.opened.store import WORKER_MODULES
from linework.runs.record import versions
from linework.runs.resume import source_hash

if TYPE_CHECKING:
    from linework.processes.executors import Executor


@contextlib.contextmanager
def cluster_executor(scheduler: Any, workers: int | None, work: Path) -> Iterator[Executor]:
    """Open the executor of a run on a cluster.

    Parameters
    ----------
    scheduler
        As for `linework.processes.cluster.open_client`.
    workers
        Worker processes of a cluster on this machine (None: as many as it has cores); any other has its own.
    work
        Work folder of the survey, which all workers must see under the same name.

    Raises
    ------
    UsageError
        `scheduler` is not the address of one, or it comes with a number of workers.
    MachineError
        It does not answer, has no workers, or one of them has another linework or does not see the folder.
    """
    from linework.processes.cluster import Cluster, open_client

    if workers is not None and scheduler != "local":
        raise UsageError("a cluster has its own workers", where=argument("workers"), advice="omit it")
    with open_client(scheduler, workers or usable_cores()) as client:
        # Of a name that no other machine can have by itself: the same folder may exist there, too
        seen = work / f"cluster-{uuid.uuid4().hex[:16]}.lock"
        with hold_lock(seen):
            check = WorkerCheck(seen, str(Path.cwd()), _versions_here())
            cluster = Cluster(client, check, modules=WORKER_MODULES)
            try:
                yield cluster
            finally:
                cluster.close()


@dataclass(frozen=True, slots=True)
class WorkerCheck:
    """What a worker must have in common with the process that runs the command.

    Parameters
    ----------
    seen
        A file that it must see.
    here
        Working folder of the command: paths may be relative to it.
    versions
        By name: hash of linework's source, versions of Python and of the packages that can change a result.
    """

    seen: Path
    here: str
    versions: dict[str, str]

    def __call__(self) -> None:
        """Check this process, which is one of ours on the machine of a worker.

        Raises
        ------
        MachineError
            The message names the machine and the first difference.
        """
        there = _versions_here()
        for name in dict.fromkeys(["linework", *self.versions, *there]):
            ours, other = (values.get(name, "not installed") for values in (self.versions, there))
            if ours != other:
                raise MachineError(
                    f"the worker there has {name} {other}, here it is {ours}",
                    where=platform.node(), advice="install the same on all workers",
                )  # fmt: skip
        with contextlib.suppress(OSError):
            os.chdir(self.here)
        try:
            if not self.seen.exists():
                raise FileNotFoundError(errno.ENOENT, "it is not the one that is used here")
            with tempfile.TemporaryFile(dir=self.seen.parent):
                pass
        except OSError as error:
            raise MachineError(
                f"the worker there cannot use the work folder {self.seen.parent} ({error.strerror})",
                where=platform.node(),
                advice=f"name a folder that all machines share and may write to with {argument('work')}",
            ) from error


def _versions_here() -> dict[str, str]:
    """Return what the lines depend on in this installation, by name."""
    return {**versions(), "source of linework": source_hash()}
