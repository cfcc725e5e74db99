"""Files that this process reads: none of them may become its output.

Whichever comes second is checked against the first: an output that is reserved before a survey is opened, and a file
that is written after one was read. Files are compared as the system knows them, so that another spelling of a path, a
symbolic link or a hard link makes no difference.
"""

from __future__ import annotations

import contextlib
import fnmatch
import itertools
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from linework.errors import UsageError

#: What identifies a file on this machine: device and inode.
_Identity = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class InputFiles:
    """Files that are read together: those of a survey, or a single one.

    Parameters
    ----------
    name
        File or folder that a user named.
    files
        Files and folders that are read.
    root
        Folder that `patterns` start from.
    patterns
        Further files: those in `root` whose path matches.
    lists
        Further files: those in the first column of these text files, from the folder of the list.
    """

    name: Path
    files: tuple[Path, ...]
    root: Path = Path()
    patterns: tuple[str, ...] = ()
    lists: tuple[Path, ...] = ()


#: All that this process has read, by name.
_NOTED: dict[Path, InputFiles] = {}
#: Outputs that are reserved, and whether each is a folder.
_RESERVED: list[tuple[Path, bool]] = []


def note_inputs(read: InputFiles) -> None:
    """Note files that are read from now on.

    Raises
    ------
    UsageError
        One of them is a reserved output, or is in a folder that is.
    """
    for output, is_folder in _RESERVED:
        _refuse(output, read, is_folder=is_folder)
    _NOTED[read.name.absolute()] = read


def check_not_read(path: Path, *, inputs: Iterable[Path | None] = (), is_folder: bool = False) -> None:
    """Refuse an output that is a file which is read.

    Parameters
    ----------
    inputs
        Files that the command is going to read; None is skipped.
    is_folder
        The output is a folder: none of `inputs` may be in it. What was read before is not looked at, because whoever
        writes a folder anew replaces it as a whole.

    Raises
    ------
    UsageError
        It is one of `inputs`, or a file was noted that is the same.
    """
    if not os.path.lexists(path):
        # May still match a pattern of a survey, and would then be read with it
        for read in () if is_folder else _NOTED.values():
            _refuse(path, read, is_folder=False)
        return
    given = [InputFiles(name=one, files=(one,)) for one in inputs if one is not None]
    for read in given if is_folder else [*given, *_NOTED.values()]:
        _refuse(path, read, is_folder=is_folder)


@contextlib.contextmanager
def reserved(path: Path, *, is_folder: bool = False) -> Iterator[None]:
    """Let nothing be opened, during the context, that this output would replace."""
    _RESERVED.append((path, is_folder))
    try:
        yield
    finally:
        _RESERVED.remove((path, is_folder))


def _refuse(output: Path, read: InputFiles, *, is_folder: bool) -> None:
    found = _input_in(output, read) if is_folder else _input_that_is(output, read)
    if found is None:
        return
    part = "" if found == read.name else f", which is a part of {read.name}"
    if is_folder:
        raise UsageError(
            f"the output folder holds the input {found}{part}", where=output, advice="choose another folder"
        )
    raise UsageError(
        f"the output is the input file {found}{part}", where=output, advice="choose another name"
    )


def _input_that_is(output: Path, read: InputFiles) -> Path | None:
    """Return the input that an output file would replace or join, or None."""
    own, root = _identities(output), read.root.resolve()
    if own:
        for file in itertools.chain(read.files, read.lists, _further_files(read)):
            if own & _identities(file):
                return file
    place = str(output.parent.resolve() / output.name)
    is_one = any(fnmatch.fnmatch(place, str(root / pattern)) for pattern in read.patterns)
    return output if is_one else None


def _further_files(read: InputFiles) -> Iterator[Path]:
    """Yield the files that patterns match and lists name."""
    for pattern in read.patterns:
        # A pattern that is none is refused where the images are looked for
        with contextlib.suppress(OSError, ValueError, NotImplementedError):
            yield from read.root.glob(pattern)
    for listing in read.lists:
        yield from _listed_files(listing)


def _input_in(folder: Path, read: InputFiles) -> Path | None:
    """Return an input that is in a folder, at any depth, or is that folder; None where there is none."""
    own = _identities(folder)
    listed = {file.parent for listing in read.lists for file in _listed_files(listing)}
    bases = {read.root.joinpath(*_plain_parts(pattern)) for pattern in read.patterns}
    seen: set[Path] = set()
    for file in (*read.files, *read.lists, *sorted(listed | bases)):
        # Both where the file is and where a link to it is
        for real in (file.resolve(), file.parent.resolve() / file.name):
            for place in (real, *real.parents):
                if place in seen:
                    break
                seen.add(place)
                if own & _identities(place):
                    return file
    return None


def _plain_parts(pattern: str) -> list[str]:
    """Return the folders of a pattern before its first wildcard."""
    parts = Path(pattern).parts[:-1]
    return list(itertools.takewhile(lambda part: not set("*?[").intersection(part), parts))


def _listed_files(listing: Path) -> Iterator[Path]:
    """Yield the files in the first column of a list."""
    with contextlib.suppress(OSError), listing.open(encoding="utf-8", errors="replace") as rows:
        for row in rows:
            yield listing.parent / row.split(",")[0].strip()


def _identities(path: Path) -> frozenset[_Identity]:
    """Return what a path leads to, and the link that it is; nothing where there is no file."""
    found: set[_Identity] = set()
    for status in (os.stat, os.lstat):
        with contextlib.suppress(OSError, ValueError):
            result = status(path)
            found.add((result.st_dev, result.st_ino))
    return frozenset(found)
