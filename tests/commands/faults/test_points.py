"""Point files that lie: group A of the list of faults. Every fault has its one line or its right answer.

A05: there is no option to keep what is left of a file that was cut off: a drive that ends early would pass for a
whole one. What is missing is said, and the file can be copied again, or left out by its name.
A24, A25: COPC files are read chunk by chunk like any LAZ file; their hierarchy is never followed.
"""

from __future__ import annotations

import json
import re
import struct
import subprocess
import sys
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
import shapely
from tests.scenes.laser_files import (
    BOX,
    EXTENDED,
    HEADER_BYTES,
    LOW,
    N_POINTS,
    N_POINTS_OLD,
    N_RECORDS,
    OFFSETS,
    POINT_FORMAT,
    POINT_OFFSET,
    RECORD_BYTES,
    SCALES,
    SIZE_M,
    VERSION_MINOR,
    chunk_table,
    drive_file,
    laszip_record,
    point_by_point,
    points_start,
)
from tests.scenes.point_faults import (
    HEAD,
    Make,
    N,
    bomb,
    changed,
    copc,
    cut_to,
    drive_file_of,
    flip_200,
    holding,
    las,
    laz,
    lies_of_copc,
    many_laz,
    no_text,
    old_las,
    old_laz,
    page_that_holds_itself,
    put,
    streamed,
    twice,
    zero_block,
)
from tests.scenes.rail_scenes import rail_scene, straight

from linework.files.las.write import write_las
from linework.files.vectors.read_write import read_lines
from linework.model.points import Points

COPY = r"Copy the file again, or leave it out\."


@dataclass(frozen=True)
class Refused:
    """A fault, how the file is made, and what the line says after the file's name (a regular expression)."""

    fault: str
    make: Make
    line: str


@dataclass(frozen=True)
class Read:
    """A fault that is survived: points used and left out, and the warnings (regular expressions)."""

    fault: str
    make: Make
    points: int = N
    said: tuple[str, ...] = ()
    rejected: int = 0


def promises(n: str, held: str) -> str:
    return rf"header promises {n} points but the file holds {held} \(cut off or damaged\)\. {COPY}"


REFUSED = [
    Refused("A01", partial(holding, b""), r"empty file \(0 bytes\)\. Copy the file again\."),
    Refused("A02", partial(holding, b"<!DOCTYPE html><title>404</title>" * 20),
            r"not a LAS/LAZ file \(it does not begin with LASF\)\. Check what this file is\."),
    Refused("A03 of any version", cut_to(las, lambda d: 200), rf"cut off inside the header: 200 of at least 227 bytes\. {COPY}"),
    Refused("A03 of version 1.4", cut_to(las, lambda d: 300), rf"cut off inside the header: 300 of 375 bytes\. {COPY}"),
    Refused("A03 in the records", cut_to(laz, lambda d: 400), rf"points should start at byte 469, but the header ends at 375 and the file at 400\. {COPY}"),
    Refused("A04", cut_to(las, lambda d: -30 * 100), promises("400", "300")),
    Refused("A04 all points", cut_to(las, points_start), promises("400", "0")),
    Refused("A05", cut_to(las, lambda d: -7), promises("400", "399")),
    Refused("A06 in the middle", cut_to(laz, lambda d: len(d) // 2),
            rf"header promises 400 points, but their chunk table at byte [\d,]+ is missing from the file of [\d,]+ \(cut off or damaged\)\. {COPY}"),
    Refused("A06 chunk table missing", cut_to(laz, chunk_table), rf".* chunk table at byte [\d,]+ is missing .*\. {COPY}"),
    Refused("A06 after the first point", cut_to(laz, lambda d: points_start(d) + 38), rf".* chunk table at byte [\d,]+ is missing .*\. {COPY}"),
    Refused("A06 in the place of the table", cut_to(laz, lambda d: points_start(d) + 4), rf".* is missing from the file .*\. {COPY}"),
    *(
        Refused(f"A07 {n} points, {make.__name__}", put(make, HEAD, *place, n), promises(f"{n:,}", held))
        for n in (4_000_000_000, 2**63, 2**64 - 1)
        for make, place, held in ((las, (N_POINTS, "Q"), "400"), (laz, (N_POINTS, "Q"), r"[\d,]+ bytes of them"))
    ),
    Refused("A07 LAS 1.2", put(old_las, HEAD, N_POINTS_OLD, "I", 2**32 - 1), promises("4,294,967,295", "400")),
    Refused("A07 LAZ 1.2", put(old_laz, HEAD, N_POINTS_OLD, "I", 2**32 - 1), promises("4,294,967,295", r"[\d,]+ bytes of them")),
    Refused("A08 one more", put(las, HEAD, N_POINTS, "Q", 401), promises("401", "400")),
    Refused("A08 one more, compressed", put(laz, HEAD, N_POINTS, "Q", 401), promises("401", "400 in 1 chunks")),
    Refused("A08 more than the chunks, no layers", put(many_laz, HEAD, N_POINTS_OLD, "I", 150_001), promises("150,001", "150,000 in 3 chunks")),
    Refused("A08 none", partial(drive_file_of, 0), r"no points \(0 in the header\)\. Leave the file out\."),
    Refused("A08 none, but points follow", put(old_las, HEAD, N_POINTS_OLD, "I", 0), r"no points \(0 in the header\), but 11,200 bytes of them follow: the recording was not closed\. Repair it with the tool that made it, or leave it out\."),
    Refused("A08 none, but compressed points follow", put(old_laz, HEAD, N_POINTS_OLD, "I", 0), r"no points \(0 in the header\), but [\d,]+ bytes of them follow: the recording was not closed\. Repair .*"),
    Refused("A08 none, but points follow one by one", put(lambda folder: point_by_point(folder / "x.laz"), HEAD, N_POINTS_OLD, "I", 0), r"no points \(0 in the header\), but [\d,]+ bytes of them follow: the recording was not closed\. Repair .*"),
    Refused("A09", put(laz, HEAD, N_RECORDS, "I", 4_000_000_000), rf"header promises 4,000,000,000 variable length records, but there are 94 bytes for them\. {COPY}"),
    Refused("A09 two instead of one", put(laz, HEAD, N_RECORDS, "I", 2), rf"header promises 2 variable length records, but there are 94 bytes for them\. {COPY}"),
    Refused("A09 a record of 65535 bytes", put(laz, 375, 20, "H", 65535), rf"variable length record 1 of 1 runs 65,495 bytes into the points\. {COPY}"),
    Refused("A10 4e9", put(las, HEAD, EXTENDED, "QI", 12_375, 4_000_000_000), rf"header promises 4,000,000,000 extended records from byte 12,375, the file ends at 12,375\. {COPY}"),
    Refused("A10 in the header", put(las, HEAD, EXTENDED, "QI", 10, 1), rf"header promises 1 extended records from byte 10, the file ends at 12,375\. {COPY}"),
    Refused("A10 past the end", put(las, HEAD, EXTENDED, "QI", 2**63, 1), rf"header promises 1 extended records from byte 9,223,372,036,854,775,808, the file ends at 12,375\. {COPY}"),
    Refused("A10 in the points", put(las, HEAD, EXTENDED, "QI", 3_000, 1), rf"(extended record 1 of 1 runs past the end of the file|.* points but the file holds 87 before other records at byte 3,000 .*)\. {COPY}"),
    Refused("A11 past the end", put(las, HEAD, POINT_OFFSET, "I", 4_000_000_000), rf"points should start at byte 4,000,000,000, but the header ends at 375 and the file at 12,375\. {COPY}"),
    Refused("A11 in the header", put(las, HEAD, POINT_OFFSET, "I", 100), rf"points should start at byte 100, but the header ends at 375 and the file at 12,375\. {COPY}"),
    Refused("A12 0 bytes", put(las, HEAD, HEADER_BYTES, "H", 0), rf"header says it is 0 bytes long, expected 375 or a little more in a file of 12,375\. {COPY}"),
    Refused("A12 65535 bytes", put(las, HEAD, HEADER_BYTES, "H", 65535), rf"header says it is 65,535 bytes long, expected 375 or a little more in a file of 12,375\. {COPY}"),
    Refused("A13 format 63", put(las, HEAD, POINT_FORMAT, "B", 63), r"point format 63, expected 0 to 10\. Convert it to LAS 1\.4\."),
    Refused("A13 records of 0 bytes", put(las, HEAD, RECORD_BYTES, "H", 0), rf"point records of 0 bytes, point format 6 needs 30\. {COPY}"),
    Refused("A13 records of 65535 bytes", put(las, HEAD, RECORD_BYTES, "H", 65535), promises("400", "0")),
    *(
        Refused(f"A14 {axis} scale {value:g}", put(las, HEAD, SCALES + 8 * i, "d", value), rf"{axis} scale is {re.escape(f'{value:g}')}, expected a size such as 0\.001\. {COPY}")
        for i, (axis, value) in enumerate((("x", 0.0), ("y", np.nan), ("z", np.inf), ))
    ),
    Refused("A14 x scale 1e-300", put(laz, HEAD, SCALES, "d", 1e-300), rf"x scale is 1e-300, expected a size such as 0\.001\. {COPY}"),
    *(
        Refused(f"A15 {axis} offset {value:g}", put(las, HEAD, OFFSETS + 8 * i, "d", value), rf"{axis} offset is {re.escape(f'{value:g}')}, expected at most 1e9\. {COPY}")
        for i, (axis, value) in enumerate((("x", np.inf), ("y", 1e300), ("z", np.nan)))
    ),
    Refused("A15 x offset 1e12", put(laz, HEAD, OFFSETS, "d", 1e12), rf"x offset is 1e\+12, expected at most 1e9\. {COPY}"),
    *(
        Refused(f"A19 chunk table at {at}", put(laz, points_start, 0, "q", at), rf".* chunk table at byte [-\d,]+ is missing from the file of [\d,]+ \(cut off or damaged\)\. {COPY}")
        for at in (-1, 2**62, 0)
    ),
    Refused("A21 item of 65535 bytes", put(laz, laszip_record, 36, "H", 65535), rf"laszip items add up to 65535 bytes a point, the header says 30\. {COPY}"),
    Refused("A21 60000 items", put(laz, laszip_record, 32, "H", 60000), rf"laszip record promises 60000 items in 40 bytes\. {COPY}"),
    Refused("A21 no record", changed(laz, lambda d: d.__setitem__(slice(377, 391), b"another record")), rf"points are compressed, but the laszip record is missing\. {COPY}"),
    Refused("A22 zeros in a chunk with layers", changed(partial(drive_file_of, 120_000), zero_block), rf"(chunk \d of \d|chunk \d after [\d,]+ points|points [\d,]+ to [\d,]+ of 120,000 cannot be decoded).*\. {COPY}"),
    Refused("A22 chunk of 4e9 points", put(laz, points_start, 8 + 30, "I", 2**32 - 1), rf"chunk 1 of 1 holds 4,294,967,295 points, the laszip record says 50,000\. {COPY}"),
    Refused("A22 layer of 4 GB", put(laz, points_start, 8 + 30 + 4, "I", 2**32 - 1), rf"chunk 1 after 0 points is damaged \([\d,]+ bytes, there are [\d,]+\)\. {COPY}"),
    Refused("A22 chunks of 1 point", put(laz, laszip_record, 12, "I", 1), rf"chunk 1 of 1 holds 400 points, the laszip record says 1\. {COPY}"),
    Refused("A22 chunks of 4e9 points", put(laz, laszip_record, 12, "I", 4_000_000_000), rf"laszip record says chunks of 4,000,000,000 points, expected some 50,000\. {COPY}"),
    Refused("A25 chunk table of a COPC file", put(copc, chunk_table, 0, "I", 1524), rf"damaged chunk table, and chunks of different sizes cannot be found without it\. {COPY}"),
    Refused("A26 compressor 99", put(laz, laszip_record, 0, "H", 99), r"LAZ compressor 99, expected 1 to 3: made by a newer tool\. Convert it to LAS 1\.4 with the tool that made it\."),
    Refused("A26 items of version 4", put(laz, laszip_record, 38, "H", 4), r"LAZ items of version 4, expected at most 3: made by a newer tool\. Convert it to LAS 1\.4 with the tool that made it\."),
    Refused("A26 LAS 1.5", put(las, HEAD, VERSION_MINOR, "B", 5), r"LAS version 1\.5, expected 1\.0 to 1\.4: made by a newer tool\. Convert it to LAS 1\.4\."),
    Refused("A27", bomb(60), r"header promises 3,000,000 points in [\d,]+ bytes, \d+ to a byte: scanner points do not compress that far\. Leave it out\."),
]  # fmt: skip

READ = [
    Read("A08 100 fewer", put(las, HEAD, N_POINTS, "Q", 300), 300, (r"3,000 bytes after the last of 300 points",)),
    Read("A08 100 fewer, compressed", put(laz, HEAD, N_POINTS, "Q", 300), 300,
         (r"chunks for 400 points, the header says 300: the others are not read",)),
    *(
        Read(f"A08 {n:,} of {of:,} in chunks without layers", put(make, HEAD, N_POINTS_OLD, "I", n), n,
             (rf"more points in the file than the {n:,} that its header says: the others are not read",))
        for make, of, n in ((old_laz, N, N - 1), (old_laz, N, 1), (many_laz, 120_000, 119_999), (many_laz, 120_000, 100_001))
    ),
    Read("A08 a chunk fewer, without layers", put(many_laz, HEAD, N_POINTS_OLD, "I", 100_000), 100_000,
         (r"chunks for 150,000 points, the header says 100,000: the others are not read",)),
    Read("A14 negative scale", put(las, HEAD, SCALES, "d", -0.001), N, (r"x scale is negative \(-0\.001\)", r"\d+ of 400 points lie outside the bounding box in its header")),
    Read("A16 inverted", put(las, HEAD, BOX, "2d", 1.0, 2.0), N, (r"the header's bounding box is invalid \(x from 2 to 1\): not used",)),
    Read("A16 as of an empty file", put(laz, HEAD, BOX, "6d", *[-1.7976931348623157e308, 1.7976931348623157e308] * 3), N,
         (r"the header's bounding box is invalid \(x from 1\.79769e\+308 to -1\.79769e\+308\): not used",)),
    Read("A16 all zeros", put(laz, HEAD, BOX, "6d", *[0.0] * 6), N, (r"400 of 400 points lie outside the bounding box in its header",)),
    Read("A16 too small", put(las, HEAD, BOX, "d", LOW[0] + SIZE_M[0] / 2), N, (r"(19|20)\d of 400 points lie outside the bounding box in its header",)),
    Read("A17", changed(laz, no_text), N),
    Read("A18", put(laz, chunk_table, 4, "I", 4_000_000_000), N, (r"damaged chunk table: decoded one chunk after the other",)),
    Read("A19 at the end", changed(laz, streamed), N),
    Read("A20 zeros", put(laz, chunk_table, 0, "q", 0), N, (r"damaged chunk table: decoded one chunk after the other",)),
    Read("A20 zeros, no layers", put(many_laz, chunk_table, 0, "q", 0), 120_000, (r"damaged chunk table: decoded one chunk after the other",)),
    Read("A20 version 1524", put(many_laz, chunk_table, 0, "I", 1524), 120_000, (r"damaged chunk table: decoded one chunk after the other",)),
    Read("A23", changed(las, lambda d: [d.__setitem__(points_start(d) + 30 * i + 2, d[points_start(d) + 30 * i + 2] ^ 1) for i in range(7)]), N,
         (r"[1-7] of 400 points lie outside the bounding box in its header",)),
    Read("A23 far away", put(partial(las, n=5_000), points_start, 3, "B", 0x70), 4_999, (r"1 of 5,000 points lie outside the bounding box in its header", r"1 points far from all others left out"), 1),
    Read("A23 a time of no epoch", changed(las, lambda d: struct.pack_into("<d", d, points_start(d) + 30 * 7 + 22, 1e100)), N - 1, (r"1 of 400 points \(0\.25 %\) left out: 1 impossible time",), 1),
    Read("A24", changed(copc, page_that_holds_itself), N),
    Read("A25", changed(copc, lies_of_copc), N),
    Read("A26 point by point", lambda folder: point_by_point(folder / "x.laz", N), N),
    Read("A27 a million", bomb(20), 1_000_000, (r"no intensity .*", r"no GPS time .*", r"1,000,000 of .* outside the bounding box .*")),
    Read("A28 points twice", twice, 2 * N, (r"about 50% of the points repeat others \(same place, time and intensity\)",)),
]  # fmt: skip


def ids(rows):
    return [row.fault for row in rows]


def test_every_fault_has_a_test():
    named = {row.fault[:3] for row in (*REFUSED, *READ)}
    assert named | {"A28"} == {f"A{i:02}" for i in range(1, 29)}


@pytest.mark.parametrize("row", REFUSED, ids=ids(REFUSED))
def test_a_point_file_that_lies_is_refused(linework, tmp_path, row):
    path = row.make(tmp_path / "in")
    before = sorted(tmp_path.rglob("*"))
    found = linework("extract", path, "-o", tmp_path / "out" / "lines.gpkg", "--crs", "local", "--quiet")
    assert found.code == 3, found.stderr
    assert found.stderr == f"{found.line}\n"
    start = f"error: {path}: "
    assert found.line.startswith(start)
    said = found.line.removeprefix(start)
    assert re.fullmatch(row.line, said), said
    assert len(said) <= 300 - len("error: x.copc.laz: ")
    assert [p for p in sorted(tmp_path.rglob("*")) if ".linework" not in p.parts] == before


@pytest.mark.parametrize("row", READ, ids=ids(READ))
def test_a_point_file_that_lies_is_read_all_the_same(linework, tmp_path, row):
    path = row.make(tmp_path)
    found = linework("info", path, "--crs", "local", "--json", "--quiet")
    assert (found.code, found.stderr) == (0, "")
    document = json.loads(found.stdout)
    assert document["points"] == row.points
    assert sum(document["points_rejected"].values()) == row.rejected
    said = [text.removeprefix(f"{path.name}: ") for text in document["warnings"]]
    assert len(said) == len(row.said), said
    for text, expected in zip(sorted(said), sorted(row.said), strict=True):
        assert re.fullmatch(expected, text), said


#: Makes every lie of the table that is told by the header, in as little address space as lies would need.
FRUGAL = """
import resource, sys
from pathlib import Path
from linework.errors import InputError
from linework.files.survey.open import open_survey
import linework.files.las.header

in_use = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (in_use + (200 << 20),) * 2)
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
n_refused = 0
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        open_survey([path], crs="local")
        print(path.name, "is read")
    except InputError:
        n_refused += 1
print(n_refused)
"""


def test_header_lies_are_refused_in_little_memory(tmp_path):
    """200 MB of addresses, 0.3 s of processor each on average (a thousandth of that is used)."""
    rows = [row for row in REFUSED if row.fault[:3] not in ("A22", "A27")]
    for i, row in enumerate(rows):
        made = row.make(tmp_path / f"{i}")
        made.rename(tmp_path / f"{i}{made.suffix}")
        (tmp_path / f"{i}").rmdir()
    found = subprocess.run(
        [sys.executable, "-c", FRUGAL, tmp_path], capture_output=True, text=True, timeout=120
    )
    refused = sum(not row.fault.startswith("A08 none") or "follow" in row.fault for row in rows)
    assert found.stderr == ""
    assert found.stdout.splitlines()[-1] == str(refused)


def test_the_other_files_of_a_survey_go_on(linework, tmp_path):
    """One of each class of fault beside a sound file: finished, but not all (4), each named with its line."""
    chosen = ("A01", "A02", "A03 of version 1.4", "A04", "A06 in the middle", "A08 none, but points follow", "A09",
              "A14 x scale 0", "A19 chunk table at 0", "A21 item of 65535 bytes", "A22 layer of 4 GB", "A26 compressor 99")  # fmt: skip
    folder, rows = tmp_path / "drive", [row for row in REFUSED if row.fault in chosen]
    assert len(rows) == len(chosen)
    drive_file(folder / "sound.laz", 6, N)
    bad = {}
    for i, row in enumerate(rows):
        made = row.make(tmp_path / "in")
        bad[str(made.rename(folder / f"{i:02}{made.suffix}"))] = row
    output = tmp_path / "lines.gpkg"
    found = linework("extract", folder, "-o", output, "--crs", "local", "--quiet")
    assert found.code == 4, found.stderr
    assert found.line.startswith(f"error: {output}: {len(bad)} of {len(bad) + 1} files left out: ")
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["counts"]["points_used"] == N
    assert {failure["file"] for failure in record["failures"]} == set(bad)
    for failure in record["failures"]:
        said = failure["problem"].removeprefix(f"{failure['file']}: ")
        assert re.fullmatch(bad[failure["file"]].line, said), said


def test_a08_a_file_without_points_among_others_is_no_error(linework, tmp_path):
    drive_file(tmp_path / "a.laz", 6, N)
    drive_file(tmp_path / "empty.laz", 6, 0)
    found = linework("info", tmp_path, "--crs", "local", "--json", "--quiet")
    assert found.code == 0, found.stderr
    document = json.loads(found.stdout)
    assert (document["points"], document["warnings"]) == (
        N,
        ["empty.laz: no points (0 in the header), left out"],
    )


def test_a22_damage_that_a_decoder_meets_names_the_points(linework, tmp_path):
    """Without layers only decoding shows it: it is refused, or all points are there and the odd ones are told."""
    path = changed(many_laz, zero_block)(tmp_path)
    found = linework("info", path, "--crs", "local", "--json", "--quiet")
    if found.code == 3:
        assert re.fullmatch(
            rf"error: {re.escape(str(path))}: points [\d,]+ to [\d,]+ of 120,000 cannot be decoded .*",
            found.line,
        )
    else:
        document = json.loads(found.stdout)
        assert document["points"] + sum(document["points_rejected"].values()) == 120_000
        assert any("outside the bounding box" in text for text in document["warnings"])


@pytest.mark.parametrize("seed", range(3))
def test_a22_flipped_bytes(linework, tmp_path, seed):
    path = changed(partial(drive_file_of, 5_000), partial(flip_200, seed=seed))(tmp_path)
    found = linework("info", path, "--crs", "local", "--json", "--quiet")
    if found.code == 3:
        assert re.search(
            r"(points [\d,]+ to [\d,]+ of 5,000|chunk 1 ).*\. Copy the file again, or leave it out\.$",
            found.line,
        )
    else:
        document = json.loads(found.stdout)
        assert document["points"] + sum(document["points_rejected"].values()) == 5_000
        assert any("outside the bounding box" in text for text in document["warnings"])


def test_a28_points_that_are_there_twice_give_each_line_once(linework, tmp_path):
    xyz = straight(rail_scene(np.random.default_rng(4), s=(2.13, 37.91)), 0.31) + LOW
    time = 3e8 + np.arange(len(xyz)) * 1e-5
    points = Points(xyz, intensity=np.full(len(xyz), 500, np.float32), time_s=time)
    write_las(points, tmp_path / "once.laz", crs="local")
    write_las(points.take(np.tile(np.arange(len(xyz)), 2)), tmp_path / "twice.laz", crs="local")
    lines = []
    for name in ("once", "twice"):
        output = tmp_path / f"{name}.gpkg"
        found = linework(
            "extract", tmp_path / f"{name}.laz", "-o", output, "--crs", "local", "--quiet", "--workers", "1"
        )
        assert found.code == 0, found.stderr
        assert ("about 50% of the points repeat others" in found.stderr) == (name == "twice")
        lines.append(read_lines(output))
        (tmp_path / "run.json").unlink()
    once, doubled = lines
    assert len(once) == len(doubled) == 1
    assert shapely.hausdorff_distance(*(shapely.LineString(found.xyz) for found in lines)) < 0.02


def test_a28_a_file_under_two_names(linework, tmp_path):
    """The same bytes, and the same points in other bytes: read once, and said."""
    drive_file(tmp_path / "a.las", 6, N)
    drive_file(tmp_path / "b.laz", 6, N)
    (tmp_path / "c.las").write_bytes((tmp_path / "a.las").read_bytes())
    found = linework("info", tmp_path, "--crs", "local", "--json", "--quiet")
    assert found.code == 0, found.stderr
    document = json.loads(found.stdout)
    assert document["points"] == N
    assert document["warnings"] == [
        "b.laz: about 100% of the points are in a.las too (same place, time and intensity), left out",
        "c.las: the same bytes as a.las, left out",
    ]
