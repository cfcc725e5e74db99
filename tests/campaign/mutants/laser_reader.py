"""Thousands of damaged laser files through our reader: nothing may hang, crash, lie, or eat memory.

``python -m benchmarks.mutations 12000 --first-seed 0`` prints what came of them, and the seeds of those that
broke a rule; ``--seed 4711 --keep x.laz`` writes one of them. Header lies are timed first.

Rules: an answer within 10 s; no signal, no traceback, also not in the process that decodes; points used and
left out add up to the points that the damaged header promises; every coordinate finite.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import select
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks._damage import damaged, make_bases

#: Nothing may take longer; the decoder is ended after so long without a word, here sooner than in a run.
HANG_S, STALL_S = 30.0, 10.0
#: Files of other projects' tests, where they lie beside the repository.
HOSTILE = Path(__file__).parents[1] / "../shared/data/hostile"


#: Takes long: not among those that are run without being named.
ON_REQUEST = True


def main(arguments=()):
    options = parsed(arguments)
    with tempfile.TemporaryDirectory(prefix="linework-mutations-") as folder:
        bases = all_bases(Path(folder) / "bases")
        if options.worker:
            work(Path(options.worker))
            return
        if options.seed is not None:
            name, done, data = damaged(options.seed, bases)
            Path(options.keep or f"mutant-{options.seed}.laz").write_bytes(data)
            print(f"seed {options.seed}: {name}, {done}")
            return
        header_lies(Path(folder))
        start = time.perf_counter()
        seeds = range(options.first_seed, options.first_seed + options.n)
        halves = [seeds[i :: options.workers] for i in range(options.workers)]
        with ThreadPoolExecutor(options.workers) as pool:
            parts = list(pool.map(lambda half: Watched(Path(folder)).run(half), halves))
        tell([result for part in parts for result in part], time.perf_counter() - start)


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations")
    parser.add_argument("n", nargs="?", type=int, default=12_000, help="how many damaged files")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, help="write the file of one seed, and stop")
    parser.add_argument("--keep", help="where to write it")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    return parser.parse_args(list(arguments))


def all_bases(folder):
    """Return the bytes of all sound files by name."""
    bases = make_bases(folder)
    for path in sorted(HOSTILE.rglob("*.la[sz]")):
        bases[f"found-{path.relative_to(HOSTILE)}"] = path.read_bytes()
    return bases


class Watched:
    """A process that reads damaged files one after the other, ended and begun anew where it hangs or dies."""

    def __init__(self, folder):
        self.folder = folder
        self.process = None

    def run(self, seeds):
        results = [self.ask({"seed": seed}) for seed in seeds]
        self.end()
        return results

    def ask(self, job):
        """Return what came of one job."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "benchmarks.mutations", "--worker", str(self.folder)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1,
                env={**os.environ, "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )  # fmt: skip
            self.line(120.0)  # ready: imports and bases take seconds
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        start = time.perf_counter()
        line = self.line(HANG_S)
        if line:
            return {**job, **json.loads(line)}
        hung = self.process.poll() is None and time.perf_counter() - start >= HANG_S
        self.process.kill()
        code = self.process.wait()
        self.process = None
        return {**job, "came": "HANG" if hung else f"SIGNAL {-code}", "bad": True, "said": ""}

    def line(self, timeout_s):
        ready, _, _ = select.select([self.process.stdout], [], [], timeout_s)
        return self.process.stdout.readline() if ready else ""

    def end(self):
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait(30)
            self.process = None


def work(folder):
    """Read jobs from stdin, one line each, and say what came of them."""
    own = folder / f"worker{os.getpid()}"
    bases = all_bases(own)
    with Reader(own) as reader:
        target = own / "mutant.laz"
        target.write_bytes(bases["laz-6.laz"])
        judged(reader, target)  # imports and caches are not to be the first one's
        print("ready", flush=True)
        for line in sys.stdin:
            job = json.loads(line)
            if "file" in job:
                result = judged(reader, Path(job["file"]))
            else:
                name, done, data = damaged(job["seed"], bases)
                target = own / f"mutant{Path(name).suffix}"
                target.write_bytes(data)
                result = {"base": name, "done": done, **judged(reader, target)}
            print(json.dumps(result), flush=True)


class Reader:
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


def judged(reader, path):
    """Return what reading a file came to, against the rules."""
    before = reset_peaks_mb()
    start = time.perf_counter()
    came, said, bad = outcome(reader, path)
    ms = 1e3 * (time.perf_counter() - start)
    return {
        "came": came,
        "said": said,
        "bad": bad,
        "ms": ms,
        "mb": sum(peaks_mb().values()) - sum(before.values()),
    }


def outcome(reader, path):
    """Return (kind of outcome, message, does it break a rule)."""
    from linework.errors import CrsError, LineworkError

    try:
        try:
            return account(path, *reader.read(path, None))
        except CrsError:  # files made here say none, damaged ones may say any
            return account(path, *reader.read(path, "local"))
    except LineworkError as error:
        text = str(error).replace(str(path), "FILE")
        if "the decoder" in text:
            return f"CONTAINED {text.split('(')[0]}", text, True
        one_line = "\n" not in text and len(text) <= 300 and text.endswith(".") and bool(error.advice)
        return f"refused ({type(error).__name__})", text, not one_line
    except BaseException as error:
        return f"TRACEBACK {type(error).__name__}", str(error)[:300], True


def account(path, header, found):
    """Compare the account of a file with its own header, read apart from our reader."""
    counted = found.n_points + sum(found.n_rejected.values())
    with path.open("rb") as file:
        promised = promised_points(file.read(375))
    if counted != promised or found.runs.n_points != found.n_points:
        return "SILENT LOSS", f"{counted} of {promised}, {found.runs.n_points} written", True
    times = () if found.gps_time_kind == "none" else (found.times.low_s, found.times.high_s)
    if not all(map(math.isfinite, (*found.low, *found.high, *times))):
        return "NOT FINITE", f"{found.low} to {found.high}, times {times}", True
    warnings = (*header.warnings, *found.warnings)
    return ("read, warned" if warnings else "read"), " | ".join(warnings), False


def promised_points(head):
    """Return the points a header promises."""
    old = struct.unpack_from("<I", head, 107)[0]
    return (struct.unpack_from("<Q", head, 247)[0] if head[25] == 4 else 0) or old


def processes():
    """Return this process and those it started."""
    own = os.getpid()
    children = Path(f"/proc/{own}/task/{own}/children").read_text().split()
    return [own, *map(int, children)]


def reset_peaks_mb():
    """Forget the highest memory so far, and return what is in use."""
    for process in processes():
        Path(f"/proc/{process}/clear_refs").write_text("5")
    return peaks_mb()


def peaks_mb():
    """Return the highest memory of this process and those it started."""
    found = {}
    for process in processes():
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        found[process] = sum(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
    return found


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


def header_lies(folder):
    """Time the refusal of each lie in a process of its own kind, LAS and LAZ of 100,000 points."""
    from tests.scenes.laser_files import drive_file

    print(f"{'header lie':28} {'file':5} {'ms':>8} {'MB':>7}  outcome")
    watched = Watched(folder)
    for suffix in ("las", "laz"):
        sound = drive_file(folder / f"sound.{suffix}", 6, 100_000).read_bytes()
        for name, part, place, form, value in LIES:
            if suffix == "las" and part != "head":
                continue
            path = folder / f"lie.{suffix}"
            path.write_bytes(with_lie(sound, part, place, form, value))
            watched.ask({"file": str(path)})  # the first reading fills caches
            result = watched.ask({"file": str(path)})
            print(
                f"{name:28} {suffix:5} {result.get('ms', math.nan):8.2f} {result.get('mb', math.nan):7.1f}  "
                f"{result['came']}: {result['said']}"
            )
    watched.end()


def with_lie(data, part, place, form, value):
    """Return the file with one number replaced."""
    changed = bytearray(data)
    points = struct.unpack_from("<I", data, 96)[0]
    start = {"head": lambda: 0, "laszip": lambda: data.index(b"laszip encoded") + 52, "points": lambda: points,
             "table": lambda: struct.unpack_from("<q", data, points)[0]}[part]()  # fmt: skip
    struct.pack_into(form, changed, start + place, *(value if isinstance(value, tuple) else (value,)))
    return bytes(changed)


def tell(results, wall_s):
    """Print the outcomes and the offenders."""
    print(f"\n{len(results):,} damaged files in {wall_s:.0f} s")
    for came, n in Counter(result["came"] for result in results).most_common():
        print(f"  {came:30} {n:7,}")
    timed = sorted(results, key=lambda result: result.get("ms", 0.0))
    eaters = sorted(results, key=lambda result: result.get("mb", 0.0))
    print("slowest: " + ", ".join(f"{r['ms']:.0f} ms (seed {r['seed']})" for r in timed[-3:] if "ms" in r))
    print(
        "most memory: " + ", ".join(f"{r['mb']:.0f} MB (seed {r['seed']})" for r in eaters[-3:] if "mb" in r)
    )
    offenders = [result for result in results if result["bad"]]
    print(f"rules broken: {len(offenders)}")
    for r in offenders[:50]:
        print(f"  seed {r['seed']}: {r['came']} {r.get('base', '')} [{r.get('done', '')}] {r['said']}")


if __name__ == "__main__":
    main(sys.argv[1:])
