"""Decode laser files in a process of their own, watched: it may die or hang without taking the run along.

Four changed bytes in a LAZ file can make a decoder abort its process, take all memory, or never come back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Self

from linework.errors import InputError
from linework.files.decode_messages import Decoded, DecodeTask
from linework.files.decoder_process import DecoderDiedError, DecoderProcess
from linework.files.decoder_process import DecoderLimits as DecoderLimits


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
