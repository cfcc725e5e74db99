"""Damaged laser files through our reader, and whether the account of their points balances.

Headers are read in this process and points in the one that decodes, as a run does. Points used and left out add up to
the points that the damaged header promises; every coordinate is finite.
"""

from __future__ import annotations

import math
import struct

from tests.campaign.mutants.laser_damage import make_bases
from tests.scenes.places import REAL

#: The decoder is ended after so long without a word, sooner than in a run. [s]
STALL_S = 10.0
#: Files of other projects' tests, where they lie beside the repository.
HOSTILE = REAL / "hostile"


def laser_bases(folder):
    """Return the bytes of all sound files by name."""
    bases = make_bases(folder)
    for path in sorted(HOSTILE.rglob("*.la[sz]")):
        bases[f"found-{path.relative_to(HOSTILE)}"] = path.read_bytes()
    return bases


class LaserReader:
    """Reads single files as a run does: headers in this process, points in the one that decodes."""

    def __init__(self, folder):
        from linework.files.las.decoder import Decoder, DecoderLimits

        self.target = folder / "0.points"
        self.decoder = Decoder(1, DecoderLimits(stall_s=STALL_S))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.decoder.close()

    def read(self, path, crs):
        """Return what the decoder found; errors as a run raises them."""
        from linework.files.las.decoder_messages import DecodeTask
        from linework.files.store.build import plan_files
        from linework.files.survey.open import open_survey

        planned, found = plan_files(open_survey([path], crs=crs))
        if not planned:
            raise found.failures.get(path) or found.empty
        self.target.unlink(missing_ok=True)
        task = DecodeTask(path=path, target=self.target, factors=planned[0].crs.factors)
        return planned[0].header, self.decoder.decode(task, lambda _: None)


def laser_outcome(reader, path):
    """Return (kind of outcome, message); errors as a run raises them."""
    from linework.errors import CrsError

    try:
        return account(path, *reader.read(path, None))
    except CrsError:  # files made here say none, damaged ones may say any
        return account(path, *reader.read(path, "local"))


def account(path, header, found):
    """Compare the account of a file with its own header, read apart from our reader."""
    counted = found.n_points + sum(found.n_rejected.values())
    with path.open("rb") as file:
        promised = promised_points(file.read(375))
    if counted != promised or found.runs.n_points != found.n_points:
        return "SILENT LOSS", f"{counted} of {promised}, {found.runs.n_points} written"
    times = () if found.gps_time_kind == "none" else (found.times.low_s, found.times.high_s)
    if not all(map(math.isfinite, (*found.low, *found.high, *times))):
        return "SILENT LOSS", f"not finite: {found.low} to {found.high}, times {times}"
    warnings = (*header.warnings, *found.warnings)
    return ("read, warned" if warnings else "read"), " | ".join(warnings)


def promised_points(head):
    """Return the points a header promises."""
    old = struct.unpack_from("<I", head, 107)[0]
    return (struct.unpack_from("<Q", head, 247)[0] if head[25] == 4 else 0) or old


#: What a header of 100,000 points may lie about: name, place from the start of a part, format, value.
LIES = (
    ("4e9 points", "head", 247, "<Q", 4_000_000_000), ("2^63 points", "head", 247, "<Q", 2**63),
    ("2^64-1 points", "head", 247, "<Q", 2**64 - 1), ("1 point more", "head", 247, "<Q", 100_001),
    ("4e9 VLRs", "head", 100, "<I", 4_000_000_000), ("4e9 EVLRs", "head", 235, "<QI", (2000, 4_000_000_000)),
    ("EVLRs in the header", "head", 235, "<QI", (10, 1)), ("EVLRs past the end", "head", 235, "<QI", (2**62, 1)),
    ("points start past the end", "head", 96, "<I", 4_000_000_000), ("header of 0 bytes", "head", 94, "<H", 0),
    ("header of 65535 bytes", "head", 94, "<H", 65535), ("point format 63", "head", 104, "<B", 63),
    ("records of 0 bytes", "head", 105, "<H", 0), ("records of 65535 bytes", "head", 105, "<H", 65535),
    ("scale nan", "head", 131, "<d", math.nan), ("offset 1e300", "head", 155, "<d", 1e300),
    ("item of 65535 bytes", "laszip", 36, "<H", 65535), ("60000 items", "laszip", 32, "<H", 60000),
    ("compressor 99", "laszip", 0, "<H", 99), ("chunks of 4e9 points", "laszip", 12, "<I", 4_000_000_000),
    ("4e9 chunks", "table", 4, "<I", 4_000_000_000), ("chunk table at 2^62", "points", 0, "<q", 2**62),
    ("chunk table at -1", "points", 0, "<q", -1), ("chunk table at 0", "points", 0, "<q", 0),
    ("chunk layer of 4 GB", "points", 8 + 30 + 4, "<I", 2**32 - 1), ("chunk of 4e9 points", "points", 8 + 30, "<I", 2**32 - 1),
)  # fmt: skip


def with_lie(data, part, place, form, value):
    """Return the file with one number replaced."""
    changed = bytearray(data)
    points = struct.unpack_from("<I", data, 96)[0]
    start = {"head": lambda: 0, "laszip": lambda: data.index(b"laszip encoded") + 52, "points": lambda: points,
             "table": lambda: struct.unpack_from("<q", data, points)[0]}[part]()  # fmt: skip
    struct.pack_into(form, changed, start + place, *(value if isinstance(value, tuple) else (value,)))
    return bytes(changed)
