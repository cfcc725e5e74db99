"""The child process of `linework.files.las.decoder`: a damaged file can crash this process and nothing else.

Separate from `decoder`, because it runs in the child process and imports the modules that decode and write points.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError, MachineError
from linework.files.clouds.e57_header import E57Scans
from linework.files.clouds.e57_points import read_e57_batches
from linework.files.clouds.rows import read_cloud_batches
from linework.files.las.batches import LasBatch, read_las_batches
from linework.files.las.decoder_messages import Decoded, DecodeTask, error_message, json_message
from linework.files.las.header import LasHeader, read_las_header
from linework.files.las.last_chunk import last_chunk_warnings
from linework.files.las.repeats import PointSample, repeated_inside
from linework.files.las.tally import HeaderBox, LasTally, TimeCounts, TimeVerdict
from linework.model.points import Points
from linework.processes.channel import Channel
from linework.processes.child import OUT_OF_MEMORY
from linework.scanlines.fields import laser_column

if TYPE_CHECKING:
    from linework.files.store.layout import RunTable
    from linework.files.store.write import StoreWriter

#: Sends a message (see `linework.files.las.decoder_messages`) to the run.
SendReport = Callable[[Mapping[str, Any]], None]
#: Largest coordinates that may be a longitude and a latitude. [deg]
_LONGEST_DEG, _NORTHMOST_DEG = 180.0, 90.0


def decoder_main(channel: Channel, _arguments: list[str]) -> None:
    """Decode the file of each task received, until the channel closes."""

    def report(message: Mapping[str, Any]) -> None:
        channel.send(json_message(message))

    report({"ready": True})
    _import_ahead("linework.files.store.write")
    while True:
        try:
            task = DecodeTask.from_message(channel.receive())
        except EOFError:
            return
        report(run_decode_task(task, report))


def run_decode_task(task: DecodeTask, report: SendReport) -> dict[str, Any]:
    """Run a task and return its final message; exceptions become messages too."""
    try:
        if task.finds_laser:
            return {"done": {"laser": _laser_of(task)}}
        return {"done": decode_file(task, report).to_document()}
    except (InputError, MachineError) as error:
        return {"refused": error_message(error)}
    except MemoryError:
        return {"died": OUT_OF_MEMORY}
    except Exception:
        return {"fault": traceback.format_exc()}
    except BaseException as error:  # a panic of the LAZ library is not an Exception
        return {"died": f"{type(error).__name__}: {error}"}


def decode_file(task: DecodeTask, report: SendReport) -> Decoded:
    """Write the points of a laser file to a file of the tile store, and return what was written.

    Raises
    ------
    InputError
        Damaged, cut off, or without any usable point.
    MachineError
        The disk is full or has failed.
    """
    header = read_las_header(task.path)
    written = _write(
        task, header, LasTally(keeps_noise=task.keeps_noise, continues_week=task.continues_week), report
    )
    verdict = written.tally.verdict(header)
    if written.tally.must_go_without_time:
        task.target.unlink()
        written = _write(task, header, LasTally(uses_time=False, keeps_noise=task.keeps_noise), report)
    return _decoded(written, verdict, last_chunk_warnings(task.path, header))


def _laser_of(task: DecodeTask) -> str:
    """Return which of the columns `carry` has the laser of a spinning scanner, "" for none, by the first points."""
    header = read_las_header(task.path)
    with contextlib.closing(_batches(task, header)) as batches:
        first = next(batches)
        further = dict(zip(task.carry, first.columns.copy(), strict=True))
        return laser_column(Points(first.xyz, time_s=first.time_s, columns=further))


class _Written:
    """Counts, samples and runs collected while a file is written."""

    __slots__ = ("box", "height_counts", "repeats", "runs", "samples", "tally")

    def __init__(self, tally: LasTally, task: DecodeTask, header: LasHeader) -> None:
        self.tally = tally
        self.box = HeaderBox(header, task.factors)
        self.repeats = PointSample(task.repeat_bits)
        self.samples: list[FloatArray] = []
        self.runs: RunTable
        self.height_counts: Mapping[int, int]


def _write(task: DecodeTask, header: LasHeader, tally: LasTally, report: SendReport) -> _Written:
    """Write all batches and return their counts; on failure the target is removed."""
    written = _Written(tally, task, header)
    writer = None
    batches = _batches(task, header)
    try:
        with contextlib.closing(batches):
            for batch in batches:
                writer = writer or _writer(task.target, report)
                first = -tally.n_kept % task.sample_step
                xyz, intensity, time, columns = tally.add(batch)
                writer.append(xyz, intensity, time, columns)
                written.samples.append(xyz[first :: task.sample_step].copy())
                written.box.add(xyz, tally.low, tally.high)
                written.repeats.add(xyz, intensity, time)
                report({"read": tally.n_read})
        if not tally.must_go_without_time:
            tally.check(task.path, header)
        assert writer is not None  # a file without points has been refused
        written.runs, written.height_counts, writer = writer.close(), writer.height_counts, None
    finally:
        if writer is not None:
            writer.abort()
    return written


def _batches(task: DecodeTask, header: LasHeader) -> Generator[LasBatch, None, None]:
    """Return the batches of a file, in whatever format it is."""
    if header.cloud is not None:
        read = read_e57_batches if isinstance(header.cloud, E57Scans) else read_cloud_batches
        return read(task.path, header, factors=task.factors, carry=task.carry, batch_points=task.batch_points)
    return read_las_batches(
        task.path, header, factors=task.factors, carry=task.carry, batch_points=task.batch_points,
        is_sequential=task.is_sequential,
    )  # fmt: skip


def _writer(target: Path, report: SendReport) -> StoreWriter:
    """Return the writer of a file; its module was imported while the first batch was decoded."""
    report({"loading": True})
    try:
        from linework.files.store.write import StoreWriter
    except (ImportError, MemoryError, OSError) as error:  # any of these when memory runs out
        raise MachineError(
            f"the module that writes points cannot be loaded ({type(error).__name__})",
            where="linework",
            advice="raise the limit on memory (ulimit -v), or check the installation",
        ) from error
    return StoreWriter(target)


def _decoded(written: _Written, verdict: TimeVerdict, more: tuple[str, ...]) -> Decoded:
    tally = written.tally
    has_time = verdict.gps_time_kind != "none"
    repeats = written.repeats.numbers()
    doubts = *written.box.warnings(tally.n_kept), *repeated_inside(repeats, has_time=has_time)
    return Decoded(
        n_points=tally.n_kept,
        n_rejected=dict(tally.n_rejected),
        low=(float(tally.low[0]), float(tally.low[1]), float(tally.low[2])),
        high=(float(tally.high[0]), float(tally.high[1]), float(tally.high[2])),
        height_counts=written.height_counts,
        gps_time_kind=verdict.gps_time_kind,
        has_intensity=tally.has_intensity,
        times=tally.time_counts if has_time else TimeCounts(),
        in_time_order=tally.in_time_order,
        sample=_sample(written.samples),
        repeats=repeats,
        runs=written.runs,
        warnings=(*more, *verdict.warnings, *doubts),
    )


def _sample(samples: list[FloatArray]) -> FloatArray | None:
    """Return the sample (k, 3) if it may hold longitudes and latitudes, else None."""
    sample = np.concatenate(samples)
    east, north = np.median(sample[:, :2], axis=0) if len(sample) else (np.inf, np.inf)
    return sample if abs(east) <= _LONGEST_DEG and abs(north) <= _NORTHMOST_DEG else None


def _import_ahead(module: str) -> None:
    """Start importing a module in a thread during the first decoding, which releases the interpreter's lock.

    The garbage collector is off meanwhile: it takes 0.1 s and finds nothing in freshly imported modules. numba loads
    scipy for linear algebra if it is installed; nothing here needs it, and hiding it saves 0.1 s.
    """
    sys.modules["scipy"] = None  # type: ignore[assignment]

    def work() -> None:
        try:
            importlib.import_module(module)
        finally:
            gc.freeze()
            gc.enable()

    gc.disable()
    threading.Thread(target=work, name="import ahead", daemon=True).start()
