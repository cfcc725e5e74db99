"""A child process: started from this program, reached over a socket, and ended with its parent."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, Any, Literal, Protocol

from linework.errors import MachineError
from linework.processes.channel import Channel
from linework.processes.connection import Offer, arguments_for, offer_connection

#: Problem of a task or request that raised MemoryError.
OUT_OF_MEMORY = "out of memory"
#: A process that closed its socket, or was killed, is gone within milliseconds. It may be stuck in a read from a
#: network disk, which no signal ends: it is left behind after this. [s]
ENDING_S = 5.0
#: Work is split between processes: libraries that start threads of their own only compete with them for the cores.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: The end of what a process printed on stderr is kept: it says why it died. [bytes]
_LAST_WORDS_BYTES = 4000
#: Reading the rest of it takes no longer once the process has ended; what it started may hold it open. [s]
_WORDS_S = 1.0


@dataclass(frozen=True, slots=True)
class Ending:
    """How a child process ended, or why it was given up; as text, what follows "the worker" in a message.

    Parameters
    ----------
    how
        It died of itself or of a signal; it was silent for too long; or it cannot go on.
    detail
        Its signal or exit code, the limit that it exceeded, or why it cannot go on.

    Examples
    --------
    >>> str(Ending.of_code(-9)), str(Ending.of_code(3)), str(Ending.hung(60.0))
    ('died (SIGKILL)', 'died (exit code 3)', 'hung (no answer for 60 s)')
    """

    how: Literal["died", "hung", "failed"]
    detail: str

    @classmethod
    def of_code(cls, code: int) -> Ending:
        """Return the ending that an exit code stands for; below 0: a signal."""
        if code >= 0:
            return cls("died", f"exit code {code}")
        with suppress(ValueError):
            return cls("died", signal.Signals(-code).name)
        return cls("died", f"signal {-code}")

    @classmethod
    def hung(cls, limit_s: float) -> Ending:
        """Return the ending of a process that sent no message within a limit [s]."""
        return cls("hung", f"no answer for {limit_s:g} s")

    def __str__(self) -> str:
        return f"{self.how} ({self.detail})"


#: What damaged memory may leave of a process before it dies.
NONSENSE = Ending("failed", "its answer makes no sense")


class ChildEndedError(Exception):
    """The process ended, or was given up, before it answered."""

    def __init__(self, ending: Ending) -> None:
        super().__init__(str(ending))
        self.ending = ending


class Started(Protocol):
    """A process that was started, as `subprocess.Popen` names what is asked of it."""

    @property
    def pid(self) -> int:
        """Number of the process."""
        ...

    def poll(self) -> int | None:
        """Return its exit code, None while it runs."""
        ...

    def wait(self, timeout: float | None = None) -> int:
        """Return its exit code once it has ended."""
        ...

    def kill(self) -> None:
        """End it."""
        ...


class Child:
    """A process that runs one function of this program.

    Parameters
    ----------
    target
        ``module:function``, and arguments for it: see `linework.processes.entry`.
    environment
        Variables beside those of this process; numerical libraries use one thread unless it says otherwise.
    address_bytes
        Limit on its address space, 0: none. [bytes]
    longest_bytes
        Longer messages from it make no sense; None: no limit. [bytes]
    keep_words
        Keep the end of what it prints on stderr, see `last_words`; else it is dropped.
    hands_on
        Connections that it hands on to processes of its own.

    Raises
    ------
    MachineError
        The system starts no more processes.

    Notes
    -----
    It belongs to the group of this process, so that what stops the group stops it, and it ends when this process ends,
    however that ends. It must be started by a thread that lives as long as it is needed: for Linux that
    thread is its parent.
    """

    def __init__(
        self, *target: str, environment: Mapping[str, str] | None = None, address_bytes: int = 0,
        longest_bytes: int | None = None, keep_words: bool = False, hands_on: Sequence[Offer] = (),
    ) -> None:  # fmt: skip
        # -P: a module in the working folder, which may be the survey's, is not ours
        command = [sys.executable, "-P", "-m", "linework.processes.entry"]
        with contextlib.closing(offer_connection()) as offer:
            try:
                process = subprocess.Popen(
                    [*command, offer.address, str(os.getpid()), str(address_bytes), *target],
                    **arguments_for(offer, hands_on),
                    env=os.environ | _ONE_THREAD | dict(environment or {}),
                    # What libraries print would come between the progress on the terminal
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE if keep_words else subprocess.DEVNULL,
                )
            except OSError as error:
                # Who writes a file meanwhile would say that the file cannot be written
                raise MachineError(
                    f"a process cannot be started: {error.strerror or error}", where="linework",
                    advice="close other programs, or raise the limits on processes and open files (ulimit -u, ulimit -n)",
                ) from error  # fmt: skip
            self.channel = Channel(offer.accept(process), longest_bytes)
        self._process: Started = process
        self._last_words = b""
        self._words_reader: threading.Thread | None = None
        if keep_words and process.stderr is not None:  # a process blocks on stderr that nobody reads
            self._words_reader = threading.Thread(
                target=self._read_words, args=(process.stderr,), name="stderr", daemon=True
            )
            self._words_reader.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    @property
    def code(self) -> int | None:
        """Its exit code, below 0: a signal; None while it runs."""
        return self._process.poll()

    @property
    def last_words(self) -> str:
        """The end of what it printed on stderr before it ended; "" unless that is kept."""
        if self._words_reader is not None:
            self._words_reader.join(_WORDS_S)
        return self._last_words.decode(errors="backslashreplace")

    def fileno(self) -> int:
        """Return the descriptor of the socket: readable when the process has sent something, or has ended."""
        return self.channel.fileno()

    def send(self, message: bytes) -> None:
        """Send a message; that a dead process cannot take it is noticed when its answer is read."""
        with suppress(OSError):
            self.channel.send(message)

    def send_object(self, value: Any) -> None:
        """Send an object, pickled (see `send`)."""
        self.send(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))

    def receive(self, timeout_s: float | None = None) -> bytes:
        """Return the next message.

        Raises
        ------
        ChildEndedError
            It ended, was silent for longer than `timeout_s`, or sent nonsense.
        """
        try:
            return self.channel.receive(timeout_s)
        except TimeoutError:
            raise ChildEndedError(Ending.hung(timeout_s or 0.0)) from None
        except (EOFError, OSError, ValueError) as error:
            raise ChildEndedError(self._ending(error)) from error

    def read_object(self) -> Any:
        """Return what the next message pickles, once `fileno` is readable; None: it has not come whole (see `receive`)."""
        try:
            message = self.channel.read()
            return None if message is None else pickle.loads(message)
        except (EOFError, OSError, ValueError) as error:
            raise ChildEndedError(self._ending(error)) from error

    def wait(self) -> Ending:
        """Return how it ended, after its end of the socket was closed, or it was killed."""
        try:
            return Ending.of_code(self._process.wait(timeout=ENDING_S))
        except subprocess.TimeoutExpired:
            return Ending("hung", "it closed its connection")

    def kill(self) -> Ending:
        """End the process, whatever it is doing, and return how it ended; its socket stays open."""
        self._process.kill()
        return self.wait()

    def end(self) -> None:
        """End the process, and close this end of its socket."""
        self.kill()
        self.channel.close()

    def _ending(self, error: Exception) -> Ending:
        """Return why nothing more is to be expected of it, by the error that its socket gave."""
        return NONSENSE if isinstance(error, ValueError) else self.wait()

    def _read_words(self, pipe: IO[bytes]) -> None:
        """Keep the end of what it prints on stderr until it ends, in a thread."""
        with pipe:
            while data := os.read(pipe.fileno(), 1 << 16):
                self._last_words = (self._last_words + data)[-_LAST_WORDS_BYTES:]
