"""Decode laser files in a child process, which may die or hang without taking the run along.

Four changed bytes in a LAZ file can make a decoder abort its process, take all memory, or never come back.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from linework.errors import InputError, MachineError
from linework.files.las.batches import BATCH_POINTS
from linework.files.las.decoder_messages import Decoded, DecodeTask, error_from_message
from linework.processes.child import NONSENSE, Child, ChildEndedError, Ending

#: glibc gives each thread an arena of 128 MiB of addresses; a few serve all threads, and the limit on addresses holds.
_FEW_ARENAS = {"MALLOC_ARENA_MAX": "4"}
#: The longest message is the table of a file's runs: this holds 4 million, and a run of a drive has thousands of
#: points. What is longer was scattered over the world by damage. [bytes]
_LONGEST_BYTES = 1 << 29
#: A machine's first run compiles the kernels that write points: 5 s, and minutes where the machine is busy. [s]
_LOADING_S = 600.0
#: Points that show whether a column has the laser of a spinning scanner: a chunk, some turns. [points]
_FIRST_POINTS = 50_000


@dataclass(frozen=True, slots=True, kw_only=True)
class DecoderLimits:
    """Limits on a decoding process.

    Parameters
    ----------
    stall_s
        Longest time without a message. One comes for every batch of points, which takes a tenth of a second, or
        seconds from a slow disk: a process that is silent for a minute hangs. [s]
    address_bytes
        Address space. A process with 64 threads takes 0.8 GiB of addresses (0.3 GiB of memory) for files of
        any size; the largest chunk a header may promise, 10 million points, twice 0.7 GiB, compressed and
        not. This is nearly twice that.
    batch_points
        Points decoded at a time; the result does not depend on it.
    target
        What the process runs, see `linework.processes.child.Child`.
    """

    stall_s: float = 60.0
    address_bytes: int = 4 << 30
    batch_points: int = BATCH_POINTS
    target: tuple[str, ...] = ("linework.files.las.decode_process:decoder_main",)


class Decoder:
    """Decodes files one after the other in a process, which is replaced when it dies.

    Parameters
    ----------
    n_threads
        Threads it decodes on.

    Notes
    -----
    The process is started at once, so that it is ready when the first file comes.
    """

    def __init__(self, n_threads: int, limits: DecoderLimits) -> None:
        self._n_threads, self._limits = n_threads, limits
        self.batch_points = limits.batch_points
        self._process: DecoderProcess | None = DecoderProcess(n_threads, limits)

    def decode(self, task: DecodeTask, progress: Callable[[int], None]) -> Decoded:
        """Decode a file; where that kills the process, once more on a single thread in a new one.

        Parameters
        ----------
        progress
            Called with the number of points of the file decoded so far.

        Raises
        ------
        InputError
            The file is damaged, or the decoder died of it twice.
        MachineError
            The disk is full, or failed.
        """
        try:
            return self._attempt(task, progress, self._n_threads)
        except DecoderDiedError:
            task.target.unlink(missing_ok=True)
        try:
            return self._attempt(replace(task, is_sequential=True), progress, 1)
        except DecoderDiedError as death:
            task.target.unlink(missing_ok=True)
            raise InputError(
                f"the decoder {death.ending} after {death.n_read:,} points (damaged)",
                where=task.path,
                advice="copy the file again, or leave it out",
            ) from death
        finally:
            self.close()  # the next file has a process with all threads

    def laser_column(self, path: Path, columns: Sequence[str]) -> str:
        """Return which of the columns of a file has the laser of a spinning scanner, "" for none.

        A file that cannot be decoded has none: `decode` says why.
        """
        process = self._process or DecoderProcess(self._n_threads, self._limits)
        self._process = process
        task = DecodeTask(
            path=path, target=path, carry=tuple(columns), batch_points=_FIRST_POINTS, finds_laser=True
        )
        try:
            laser = process.answer(task, lambda _: None)[0].get("laser", "")
        except (DecoderDiedError, InputError):
            self.close()
            return ""
        return laser if laser in columns else ""

    def _attempt(self, task: DecodeTask, progress: Callable[[int], None], n_threads: int) -> Decoded:
        process = self._process or DecoderProcess(n_threads, self._limits)
        self._process = process
        try:
            return process.decode(task, progress)
        except DecoderDiedError:
            self.close()
            raise

    def close(self) -> None:
        """End the process, whatever it is doing."""
        process, self._process = self._process, None
        if process is not None:
            process.child.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class DecoderDiedError(RuntimeError):
    """The process ended, or had to be ended, before its file was decoded."""

    def __init__(self, ending: Ending, n_read: int) -> None:
        super().__init__(str(ending))
        self.ending, self.n_read = ending, n_read


class DecoderProcess:
    """A decoding process: it takes one file after the other, and may die of any.

    Parameters
    ----------
    n_threads
        Threads it decodes on.
    """

    def __init__(self, n_threads: int, limits: DecoderLimits) -> None:
        self._stall_s = self._timeout_s = limits.stall_s
        self.child = Child(
            *limits.target,
            environment=_FEW_ARENAS | {"RAYON_NUM_THREADS": str(n_threads)},
            address_bytes=limits.address_bytes,
            longest_bytes=_LONGEST_BYTES,
            keep_words=True,
        )
        self._is_ready = False

    def decode(self, task: DecodeTask, progress: Callable[[int], None]) -> Decoded:
        """Send a task and wait for its result; raises what `answer` raises."""
        document, n_read = self.answer(task, progress)
        try:
            return Decoded.from_document(document)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise self._death(NONSENSE, n_read) from error

    def answer(self, task: DecodeTask, progress: Callable[[int], None]) -> tuple[dict[str, Any], int]:
        """Send a task and wait for what it is answered with, and the number of points decoded for it.

        Raises
        ------
        DecoderDiedError
            The process ended, was silent for too long, or sent nonsense.
        InputError
            The file is damaged, cut off, or without any usable point.
        MachineError
            The disk is full or failed; or the process ended before it was ready for a file.
        RuntimeError
            A fault of ours, with its traceback.
        """
        n_read = 0
        self.child.send(task.to_message())
        while True:
            message = self._message(n_read)
            if "ready" in message:
                self._is_ready = True
            elif "loading" in message:
                self._timeout_s = max(_LOADING_S, self._stall_s)
            elif "read" in message:
                n_read = message["read"]
                self._timeout_s = self._stall_s
                progress(n_read)
            elif "done" in message:
                done = message["done"]
                if isinstance(done, dict):
                    return done, n_read
                raise self._death(NONSENSE, n_read)
            elif "refused" in message:
                raise error_from_message(message["refused"])
            elif "died" in message:
                raise self._death(Ending("failed", message["died"]), n_read)
            elif "fault" in message:
                raise RuntimeError(f"decoding {task.path}:\n{message['fault']}")
            else:
                raise self._death(NONSENSE, n_read)

    def _message(self, n_read: int) -> dict[str, Any]:
        """Return the next message; {} if it is JSON but not an object."""
        try:
            message = json.loads(self.child.receive(self._timeout_s))
        except ChildEndedError as error:
            raise self._death(error.ending, n_read) from error
        except ValueError as error:
            raise self._death(NONSENSE, n_read) from error
        return message if isinstance(message, dict) else {}

    def _death(self, ending: Ending, n_read: int) -> DecoderDiedError | MachineError:
        """Return the error for an ending, with the last words of the process as a note."""
        words = self.child.last_words
        if not self._is_ready:
            last = (words.splitlines() or [""])[-1]
            return MachineError(
                f"the process that decodes laser files does not start: it {ending}; {last}".rstrip("; "),
                where="linework",
                advice="check the limits on memory and processes (ulimit -a), and the installation",
            )
        error = DecoderDiedError(ending, n_read)
        if words:
            error.add_note(words)
        return error
