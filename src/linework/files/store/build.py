"""Build the tile store of a survey: every file is decoded once, and every point accounted for."""

from __future__ import annotations

import functools
import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from linework.errors import InputError, MachineError, argument, did_you_mean
from linework.files.las.crs import ResolvedCrs, resolve_crs
from linework.files.las.decoder import Decoder, DecoderLimits
from linework.files.las.decoder_messages import Decoded, DecodeTask
from linework.files.las.header import LasHeader, read_las_header
from linework.files.las.repeats import repeated_elsewhere, repeats_message, sample_bits
from linework.files.las.tally import DAY_S, NO_RETURN, NOISE_CLASS, WITHHELD, TimeCounts, TimeKind
from linework.files.output.record import hash_file
from linework.files.remote.address import is_remote
from linework.files.remote.copies import RemoteCopies
from linework.files.remote.reader import remote_state
from linework.files.store.extent import refuse_degrees, stray_limits
from linework.files.store.facts import FileFacts, StoreFacts, facts_document, facts_of_store
from linework.files.store.layout import POINTS_SUFFIX, STORE_STEPS_PER_M, RunTable
from linework.files.store.read import PointStore
from linework.files.store.write import write_index
from linework.model.grid import Bounds
from linework.model.survey import Survey
from linework.scanlines.fields import BEAM_COLUMNS, USER_DATA

#: Bytes of a point in the store (key, time, intensity), and of each further column.
_POINT_BYTES, _COLUMN_BYTES = 18, 4
#: Points sampled to detect degrees: more hardly changes the 0.1 % quantiles of a million points.
_SAMPLE = 100_000


def build_store(
    survey: Survey,
    folder: Path,
    *,
    n_threads: int,
    progress: Callable[[int, int], None] | None = None,
    limits: DecoderLimits | None = None,
) -> StoreFacts:
    """Write the points of all files into a tile store; damaged files among good ones are left out and listed.

    Parameters
    ----------
    folder
        An existing, empty folder; the caller removes it if this fails.
    n_threads
        Number of decoding threads; the store does not depend on it.
    progress
        Called with the number of points read so far over all files, and the number that the headers promise.

    Raises
    ------
    InputError
        No file can be used (the first file's error), or the files' GPS times are of different kinds.
    CrsError
        A file's CRS is missing or contradicts the survey's, or the coordinates are degrees.
    MachineError
        Not enough space, or the disk failed.
    """
    if not survey.point_files:
        raise InputError(
            "no laser files in this survey", where=survey.root, advice="name them in survey.toml"
        )
    # The process starts while the headers are read
    with Decoder(n_threads, limits or DecoderLimits()) as decoder:
        planned, account = plan_files(survey)
        lacking = _files_without(planned, survey.carry)
        advance = _Advance(planned, progress)
        copies = RemoteCopies(folder, advance.fetched)
        carry = sorted({*survey.carry, *_laser_columns(decoder, planned, copies)})
        check_free_space(folder, sum(file.header.n_points for file in planned), len(carry))
        decoded = _decode_all(decoder, planned, account, copies, folder, survey, carry, advance)
    if not decoded:
        first = next((account.failures[p] for p in survey.point_files if p in account.failures), None)
        raise first or account.empty or InputError("no points", where=survey.root)
    decoded = _without_copies(decoded, account, folder)
    results = [result for _, result in decoded]
    n_points = sum(result.n_points for result in results)
    refuse_degrees([result.sample for result in results], n_points, where=decoded[0][0].path)
    facts = _facts(survey, decoded, account, lacking, carry)
    runs = RunTable.concatenate(*(result.runs for result in results))
    write_index(folder, runs, facts, stray_limits(runs, [result.height_counts for result in results]))
    return facts_of_store(PointStore.open(folder))


def _decode_all(
    decoder: Decoder,
    planned: Sequence[PlannedFile],
    account: StoreBuildAccount,
    copies: RemoteCopies,
    folder: Path,
    survey: Survey,
    carry: Sequence[str],
    advance: _Advance,
) -> list[tuple[PlannedFile, Decoded]]:
    """Decode the files one after the other; failures go into the account and leave no file."""
    n_promised = sum(file.header.n_points for file in planned)
    decoded: dict[int, Decoded] = {}

    def decode(number: int, *, continues_week: bool = False) -> None:
        file, target = planned[number], folder / f"{number}{POINTS_SUFFIX}"

        try:
            task = DecodeTask(
                path=copies.local(file.path), target=target, factors=file.crs.factors, carry=tuple(carry),
                sample_step=max(1, n_promised // _SAMPLE), repeat_bits=sample_bits(n_promised),
                batch_points=decoder.batch_points, keeps_noise=keeps_noise(survey), continues_week=continues_week,
            )  # fmt: skip
            decoded[number] = decoder.decode(task, functools.partial(advance.decoded, file.path))
            _check_result(file, decoded[number])
        except InputError as error:
            # Of a remote file the decoder knows the copy
            error.where = file.path
            account.failures[file.path] = error
            decoded.pop(number, None)
            target.unlink(missing_ok=True)
        except BaseException:
            target.unlink(missing_ok=True)
            raise
        finally:
            copies.drop(file.path)

    for number in range(len(planned)):
        decode(number)
    # The times of all files are known by now
    for number in _after_the_week(decoded):
        (folder / f"{number}{POINTS_SUFFIX}").unlink()
        decode(number, continues_week=True)
    return [(planned[number], result) for number, result in decoded.items()]


class _Advance:
    """Points done of all; those of a remote file count half once they are fetched, half once they are decoded."""

    def __init__(self, planned: Sequence[PlannedFile], progress: Callable[[int, int], None] | None) -> None:
        counts = [file.header.n_points for file in planned]
        self._counts = {file.path: count for file, count in zip(planned, counts, strict=True)}
        self._before = {file.path: sum(counts[:number]) for number, file in enumerate(planned)}
        self._n_points, self._progress = sum(counts), progress

    def fetched(self, path: Path, share: float) -> None:
        self._show(path, 0.5 * share * self._counts[path])

    def decoded(self, path: Path, n_points: int) -> None:
        self._show(path, 0.5 * (self._counts[path] + n_points) if is_remote(path) else n_points)

    def _show(self, path: Path, n_points: float) -> None:
        if self._progress is not None:
            self._progress(self._before[path] + int(n_points), self._n_points)


def _after_the_week(decoded: Mapping[int, Decoded]) -> list[int]:
    """Return the files that begin after the end of a GPS week, in surveys with files before it."""
    of_week = {number: result for number, result in decoded.items() if result.gps_time_kind == "week"}
    times = TimeCounts()
    for result in of_week.values():
        times.merge(result.times)
    if not times.ends_a_week():
        return []
    return [number for number, result in of_week.items() if result.times.low_s < DAY_S]


def _files_without(planned: Sequence[PlannedFile], carry: Sequence[str]) -> dict[str, list[Path]]:
    """Return the files that lack a further column, by its name, where others have it.

    Raises
    ------
    InputError
        No file has it; the message lists the columns of the first.
    """
    found = {}
    for name in sorted(carry):
        without = [file.path for file in planned if name not in file.header.columns]
        if without and len(without) == len(planned):
            known = list(planned[0].header.columns)
            hint = did_you_mean([name], known)
            raise InputError(
                f"no column '{name}'; it has {', '.join(known)}{hint}", where=without[0],
                advice="" if hint else "name one of these, or write it into the file as an extra dimension",
            )  # fmt: skip
        if without:
            found[name] = without
    return found


def _laser_columns(decoder: Decoder, planned: Sequence[PlannedFile], copies: RemoteCopies) -> list[str]:
    """Return the column that has the laser of a spinning scanner, if all files have one; by the first file's points."""
    there = [name for name in (*BEAM_COLUMNS, USER_DATA) if all(name in f.header.columns for f in planned)]
    if not planned or not there or not all(file.header.has_time for file in planned):
        return []
    try:
        first = copies.local(planned[0].path)
    except InputError:  # reported when its points are read
        return []
    laser = decoder.laser_column(first, there)
    return [laser] if laser else []


def _without_copies(
    decoded: Sequence[tuple[PlannedFile, Decoded]], account: StoreBuildAccount, folder: Path
) -> list[tuple[PlannedFile, Decoded]]:
    """Return the files without full copies of another; warn about those, and about partial ones."""
    has_time = all(result.gps_time_kind != "none" for _, result in decoded)
    found = repeated_elsewhere([result.repeats for _, result in decoded], has_time=has_time)
    kept = []
    for i, (file, result) in enumerate(decoded):
        if i not in found:
            kept.append((file, result))
            continue
        other, share = found[i]
        text = repeats_message(share, decoded[other][0].path.name, has_time=has_time)
        if share < 1.0:
            account.warnings[file.path].append(text)
            kept.append((file, result))
        else:
            account.warnings[file.path].append(f"{text}, left out")
            (folder / f"{result.runs.rows['file'][0]}{POINTS_SUFFIX}").unlink()
    return kept


def _check_result(file: PlannedFile, result: Decoded) -> None:
    """Refuse a file that changed while it was read, or whose points do not add up."""
    if state_of(file.path) != file.state:
        raise InputError("changed while it was read", where=file.path, advice=CHANGED_ADVICE)
    n_accounted = result.n_points + sum(result.n_rejected.values())
    if n_accounted != file.header.n_points or result.runs.n_points != result.n_points:
        raise InputError(
            f"{n_accounted:,} points read and {result.runs.n_points:,} written of {file.header.n_points:,} that the"
            " header promises",
            where=file.path,
            advice=CHANGED_ADVICE,
        )


def keeps_noise(survey: Survey) -> bool:
    """Return whether the survey.toml says that points of noise classes are to be used."""
    return bool(survey.settings.get("points", {}).get("keep_noise", False))


def left_out_warnings(results: Sequence[Decoded]) -> list[str]:
    """Return a warning if more than a few points were left out: how many, why, and what changes it."""
    rejected: Counter[str] = Counter()
    for result in results:
        rejected.update(result.n_rejected)
    n_points = sum(result.n_points for result in results) + rejected.total()
    n = rejected.total()
    # Half of the beams of a scanner on a tripod meet the sky
    if n - rejected[NO_RETURN] <= min(FEW_POINTS, FEW_SHARE * n_points):
        return []
    reasons = ", ".join(f"{count:,} {reason}" for reason, count in sorted(rejected.items()))
    advice = {
        NOISE_CLASS: "keep_noise = true in the table [points] of a survey.toml uses those of noise classes",
        WITHHELD: "withheld points are taken back with the tool that withheld them",
    }
    said = [text for reason, text in advice.items() if rejected[reason]]
    share = f"{100.0 * n / n_points:.2g} %"
    return [
        f"{n:,} of {n_points:,} points ({share}) left out: {reasons}" + "".join(f"; {text}" for text in said)
    ]


def check_free_space(folder: Path, n_points: int, n_columns: int) -> None:
    """Refuse a folder on a disk without room for a number of points with further columns.

    Raises
    ------
    MachineError
        With the space needed, and what is free.
    """
    usage = shutil.disk_usage(folder)
    needed = n_points * (_POINT_BYTES + _COLUMN_BYTES * n_columns)
    # Some network disks report no size at all
    if usage.total and needed > usage.free:
        raise MachineError(
            f"{n_points:,} points need {needed / 1e9:.3g} GB of disk, {usage.free / 1e9:.3g} GB are free", where=folder,
            advice=f"free some space, or name a folder on another disk with {argument('work', 'DIR')}",
        )  # fmt: skip


def _facts(
    survey: Survey,
    decoded: Sequence[tuple[PlannedFile, Decoded]],
    account: StoreBuildAccount,
    lacking: Mapping[str, Sequence[Path]],
    carry: Sequence[str],
) -> dict[str, object]:
    """Return the facts of the store as a JSON document."""
    files = tuple(_file_facts(file, result) for file, result in decoded)
    for facts in files:
        account.warnings[facts.path] += facts.warnings
    warnings = [f"{path.name}: {text}" for path, texts in account.warnings.items() for text in texts]
    results = [result for _, result in decoded]
    n_dark = sum(not result.has_intensity for result in results)
    if 0 < n_dark < len(results):
        warnings.append(f"{n_dark} of {len(results)} files have no intensity: set to 0 there")
    n_untimed = sum(result.gps_time_kind == "none" for result in results)
    if 0 < n_untimed < len(results):
        warnings.append(f"{n_untimed} of {len(results)} files have no GPS time: times not used")
    for name, paths in lacking.items():
        warnings.append(f"{len(paths)} of {len(results)} files have no column '{name}': NaN there")
    warnings += left_out_warnings(results)
    times = TimeCounts()
    for result in results if n_untimed == 0 else ():
        times.merge(result.times)
    follows = [a.times.high_s <= b.times.low_s for a, b in pairwise(results)]
    failures = [(p, str(account.failures[p])) for p in survey.point_files if p in account.failures]
    return facts_document(
        files, tuple(failures), tuple(warnings), times,
        gps_time_kind=_common_kind(files),
        has_intensity=n_dark < len(results),
        crs=survey.crs,
        columns=list(carry),
        has_time=n_untimed == 0,
        in_time_order=n_untimed == 0 and all(result.in_time_order for result in results) and all(follows),
    )  # fmt: skip


def _file_facts(file: PlannedFile, result: Decoded) -> FileFacts:
    # Rounded to the store's lattice, so that its points lie within
    west, south, east, north = (
        round(v * STORE_STEPS_PER_M) / STORE_STEPS_PER_M for v in (*result.low[:2], *result.high[:2])
    )
    return FileFacts(
        file.path, file.header.n_points, result.n_points, result.n_rejected, Bounds(west, south, east, north),
        result.gps_time_kind, file.header.point_format, file.header.version_text,
        (*file.header.warnings, *file.crs.warnings, *result.warnings), tuple(file.header.columns),
    )  # fmt: skip


def _common_kind(files: Sequence[FileFacts]) -> TimeKind:
    kinds = {facts.gps_time_kind: facts.path for facts in files if facts.gps_time_kind != "none"}
    if len(kinds) > 1:
        remarks = ", ".join(f"{path.name} {kind}" for kind, path in sorted(kinds.items()))
        raise InputError(
            f"GPS times of {len(kinds)} kinds: {remarks}", where=next(iter(kinds.values())),
            advice="convert them to adjusted standard GPS time, or extract the files one by one",
        )  # fmt: skip
    return next(iter(kinds), "none")


CHANGED_ADVICE = "run again when no program writes to it"


#: So many points left out are said: in a street, a thousand are a metre of a kerb. [points], [ratio]
FEW_POINTS, FEW_SHARE = 1000, 0.001


@dataclass(frozen=True, slots=True)
class PlannedFile:
    """A file with a valid header, and its state then: size, time of change, inode."""

    path: Path
    header: LasHeader
    crs: ResolvedCrs
    state: tuple[int, int, int]


@dataclass(slots=True)
class StoreBuildAccount:
    """Warnings and failures found while the store is built, by file."""

    warnings: dict[Path, list[str]]
    failures: dict[Path, InputError] = field(default_factory=dict)
    empty: InputError | None = None


def plan_files(survey: Survey) -> tuple[list[PlannedFile], StoreBuildAccount]:
    """Check the headers of all files before anything is decoded.

    Raises
    ------
    CrsError
        A file's CRS is missing, or contradicts the survey's.
    """
    planned, account = [], StoreBuildAccount({path: [] for path in survey.point_files})
    repeated = _repeated(survey.point_files)
    for path in survey.point_files:
        if path in repeated:
            account.warnings[path].append(f"the same bytes as {repeated[path].name}, left out")
            continue
        try:
            state = state_of(path)
            header = read_las_header(path)
            if is_remote(path) and not remote_state(path).tag:
                account.warnings[path].append(
                    "its server sends neither ETag nor date: a change that keeps its length goes unnoticed"
                )
        except InputError as error:
            account.failures[path] = error
            continue
        if header.n_points == 0:
            empty = InputError("no points (0 in the header)", where=path, advice="leave the file out")
            account.warnings[path].append(f"{empty.problem}, left out")
            account.empty = account.empty or empty
            continue
        crs = resolve_crs(header.projection, survey.settings.get("crs"), where=path)
        planned.append(PlannedFile(path, header, crs, state))
    return planned, account


def state_of(path: Path) -> tuple[int, int, int]:
    """Return the state of a file, which differs once it has changed: size, time of change, inode.

    Raises
    ------
    InputError
        It no longer exists.
    MachineError
        It is at an address, and its server cannot be reached or fails.
    """
    if is_remote(path):
        return remote_state(path).numbers
    try:
        status = path.stat()
    except OSError as error:
        raise InputError(f"cannot be opened: {error.strerror}", where=path, advice=CHANGED_ADVICE) from error
    return status.st_size, status.st_mtime_ns, status.st_ino


def _repeated(files: Sequence[Path]) -> dict[Path, Path]:
    """Return the files with the same bytes as an earlier one, and that one."""
    sizes = {path: path.stat().st_size for path in files if path.is_file()}
    how_often = Counter(sizes.values())
    first: dict[tuple[int, str], Path] = {}
    found = {}
    for path, size in sizes.items():
        if how_often[size] < 2 or size == 0:
            continue
        other = first.setdefault((size, hash_file(path)), path)
        if other is not path:
            found[path] = other
    return found
