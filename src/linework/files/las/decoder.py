"""Decode laser files in a process of their own, watched: it may die or hang without taking the run along.

Four changed bytes in a LAZ file can make a decoder abort its process, take all memory, or never come back.
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import TracebackType
from typing import IO, Any, Self

from linework.errors import InputError, MachineError
from linework.files.las.batches import BATCH_POINTS
from linework.files.las.messages import Decoded, DecodeTask, error_from_message


class Decoder:
    """Decodes files one after the other in a process, which is replaced when it dies.

    Parameters
    ----------
    n_threads
        Threads it decodes on.

    Notes
    -----
    The process belongs to this one's group and dies with it. It is started at once, so that it is ready when
    the first file comes.
    """

    def __init__(self, n_threads: int, limits: DecoderLimits) -> None:
        self._n_threads, self._limits = n_threads, limits
        self.batch_points = limits.batch_points
        self._process: DecoderProcess | None = DecoderProcess(n_threads, limits)

    def decode(self, task: DecodeTask, progress: Callable[[int], None]) -> Decoded:
        """Decode a file; where that kills the process, once more on a single thread in a fresh one.

        Parameters
        ----------
        progress
            Called with the points of the file decoded so far.

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
                f"{death.how} after {death.n_read:,} points (damaged)",
                where=task.path,
                advice="copy the file again, or leave it out",
            ) from death
        finally:
            self.close()  # the next file has a process with all threads

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
            process.kill()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


# A process that decodes laser files, and this end of its pipes

#: Libraries that start threads of their own take address space and give nothing here; of the memory
#: allocator's arenas each takes 128 MB of addresses.
_SPARING = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MALLOC_ARENA_MAX": "4",
}
#: Of what the process prints on stderr so much is kept: the end says why it died.
_LAST_WORDS_BYTES = 4000
#: What damage may leave of a process before it dies.
_NONSENSE = "the decoder failed (its answer makes no sense)"
#: The longest message is the table of a file's runs: this holds 4 million, and a run of a drive has thousands of
#: points. What is longer was scattered over the world by damage.
_LONGEST_BYTES = 1 << 29
#: A machine's first run compiles the kernels that write points: 5 s, and minutes where the machine is busy. [s]
_LOADING_S = 600.0
#: A process that closed its pipe is gone within milliseconds. [s]
_ENDING_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DecoderLimits:
    """What a decoding process may take.

    Parameters
    ----------
    stall_s
        It says something every batch of points, which takes a tenth of a second, or seconds from a slow
        disk: one that is silent for a minute hangs. [s]
    address_bytes
        Address space. A process with 64 threads takes 0.8 GiB of addresses (0.3 GiB of memory) for files of
        any size; the largest chunk a header may promise, 10 million points, twice 0.7 GiB, compressed and
        not. This is nearly twice that.
    batch_points
        Points decoded at a time; what comes out does not depend on it.
    program
        What Python is to run.
    """

    stall_s: float = 60.0
    address_bytes: int = 4 << 30
    batch_points: int = BATCH_POINTS
    program: tuple[str, ...] = ("-m", "linework.files.las.decode_process")


class DecoderDiedError(RuntimeError):
    """The process ended, or had to be ended, before its file was decoded."""

    def __init__(self, how: str, n_read: int) -> None:
        super().__init__(how)
        self.how, self.n_read = how, n_read


class DecoderProcess:
    """A decoding process: it takes one file after the other, and may die of any.

    Parameters
    ----------
    n_threads
        Threads it decodes on.
    """

    def __init__(self, n_threads: int, limits: DecoderLimits) -> None:
        self._limits = limits
        # -P: a module in the user's folder, which may be the survey's, is not ours
        command = [sys.executable, "-P", *limits.program, str(os.getpid()), str(limits.address_bytes)]
        self._popen = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | _SPARING | {"RAYON_NUM_THREADS": str(n_threads)},
        )
        self._stdin, self._stdout, self._stderr = self._pipes()
        self._selector = selectors.DefaultSelector()
        for pipe in (self._stdout, self._stderr):
            self._selector.register(pipe, selectors.EVENT_READ)
        self._is_ready = False
        self._patience_s = limits.stall_s
        self._unread = bytearray()
        self._last_words = b""

    def _pipes(self) -> tuple[IO[bytes], IO[bytes], IO[bytes]]:
        popen = self._popen
        assert popen.stdin is not None
        assert popen.stdout is not None
        assert popen.stderr is not None
        return popen.stdin, popen.stdout, popen.stderr

    def decode(self, task: DecodeTask, progress: Callable[[int], None]) -> Decoded:
        """Give it a task and listen until that is done."""
        n_read = 0
        with contextlib.suppress(BrokenPipeError):  # that it died shows when it is listened to
            self._stdin.write(task.to_line())
            self._stdin.flush()
        while True:
            message = self._message(n_read)
            if "ready" in message:
                self._is_ready = True
            elif "loading" in message:
                self._patience_s = max(_LOADING_S, self._limits.stall_s)
            elif "read" in message:
                n_read = message["read"]
                self._patience_s = self._limits.stall_s
                progress(n_read)
            elif "done" in message:
                return self._decoded(message["done"], n_read)
            elif "refused" in message:
                raise error_from_message(message["refused"])
            elif "died" in message:
                raise self._death(f"the decoder failed ({message['died']})", n_read)
            elif "fault" in message:
                raise RuntimeError(f"decoding {task.path}:\n{message['fault']}")
            else:
                raise self._death(_NONSENSE, n_read)

    def _decoded(self, document: Any, n_read: int) -> Decoded:
        try:
            return Decoded.from_document(document)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise self._death(_NONSENSE, n_read) from error

    def _message(self, n_read: int) -> dict[str, Any]:
        """Return the next message.

        Raises
        ------
        DecoderDiedError
            It ended, or said nothing for too long.
        MachineError
            It ended before it looked at a file.
        """
        deadline = time.monotonic() + self._patience_s
        while b"\n" not in self._unread:
            events = self._selector.select(max(deadline - time.monotonic(), 0.0))
            if not events:
                raise self._death(f"the decoder hung (no point in {self._patience_s:g} s)", n_read)
            for key, _ in events:
                data = os.read(key.fd, 1 << 20)
                if not data:
                    self._selector.unregister(key.fileobj)
                if key.fileobj is self._stderr:
                    self._last_words = (self._last_words + data)[-_LAST_WORDS_BYTES:]
                elif data and len(self._unread) < _LONGEST_BYTES:
                    self._unread += data
                elif data:
                    raise self._death(_NONSENSE, n_read)
                else:
                    raise self._death(f"the decoder died ({self._ending()})", n_read)
        end = self._unread.index(b"\n") + 1
        line = bytes(self._unread[:end])
        del self._unread[:end]
        try:
            message = json.loads(line)
        except ValueError as error:
            raise self._death(_NONSENSE, n_read) from error
        return message if isinstance(message, dict) else {}

    def _ending(self) -> str:
        """Return in words how it ended, after its end of a pipe was closed."""
        try:
            return exit_description(self._popen.wait(timeout=_ENDING_S))
        except subprocess.TimeoutExpired:
            return "it fell silent"

    def _death(self, how: str, n_read: int) -> DecoderDiedError | MachineError:
        words = self._last_words.decode(errors="backslashreplace")
        if not self._is_ready:
            last = (words.splitlines() or [""])[-1]
            return MachineError(
                f"the process that decodes laser files does not start: {how}; {last}".rstrip("; "),
                where="linework",
                advice="check the limits on memory and processes (ulimit -a), and the installation",
            )
        error = DecoderDiedError(how, n_read)
        if words:
            error.add_note(words)
        return error

    def kill(self) -> None:
        """End it and close its pipes."""
        self._popen.kill()
        # It may be stuck in a read from a network disk, which nothing ends: it is left behind then
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(timeout=_ENDING_S)
        self._selector.close()
        for pipe in (self._stdin, self._stdout, self._stderr):
            with contextlib.suppress(BrokenPipeError):
                pipe.close()


def exit_description(code: int) -> str:
    """Return how a process ended, in words.

    >>> how_ended(-9), how_ended(3)
    ('SIGKILL', 'exit code 3')
    """
    if code >= 0:
        return f"exit code {code}"
    with contextlib.suppress(ValueError):
        return signal.Signals(-code).name
    return f"signal {-code}"
