"""Every format that linework reads: sound files of it, how they are damaged, how they are read, what has to balance."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, fields
from pathlib import Path
from types import TracebackType

import numpy as np
from tests.campaign.mutants.damage import Damage, damaged_bytes, damaged_geopackage, damaged_text
from tests.campaign.mutants.laser_damage import damaged as damaged_laser
from tests.campaign.mutants.laser_reader import LaserReader, laser_bases, laser_outcome
from tests.scenes import gnss_files
from tests.scenes.drawing_scenes import some_lines
from tests.scenes.image_folders import HEIGHT, WIDTH, picture, stereo_folder

#: (what came of it, what was said); "fewer" where something is missing, which then has to be said in a warning.
Outcome = tuple[str, str]
N_LINES = 6
N_POSES = 40


@dataclass(frozen=True)
class Format:
    """A format.

    Parameters
    ----------
    make
        Writes sound files to a folder and returns those that are to be damaged.
    damage
        Damages the bytes of one.
    read
        Reads one as commands do.
    """

    make: Callable[[Path], list[Path]]
    damage: Damage
    read: Callable[[Path], Outcome]


def _lines_as(*suffixes: str) -> Callable[[Path], list[Path]]:
    def make(folder: Path) -> list[Path]:
        from linework.files.vectors.read_write import write_lines

        paths = [folder / f"lines{suffix}" for suffix in suffixes]
        for path in paths:
            write_lines(some_lines(N_LINES), path)
        return paths

    return make


def _shapefiles(folder: Path) -> list[Path]:
    import pyogrio.raw
    import shapely

    shapes = np.array(
        [shapely.LineString(np.arange(6).reshape(3, 2) + i) for i in range(N_LINES)], dtype=object
    )
    kinds = np.array(["guardrail", "cable"] * 3, dtype=object)
    pyogrio.raw.write(
        folder / "lines.shp", shapely.to_wkb(shapes), [kinds], ["kind"], geometry_type="LineString", crs="EPSG:25832",
        driver="ESRI Shapefile",
    )  # fmt: skip
    return sorted(folder.glob("lines.*"))


def _foreign_geopackage(folder: Path) -> list[Path]:
    import pyogrio.raw
    import shapely

    path = folder / "foreign.gpkg"
    shapes = np.array(
        [shapely.LineString(np.arange(6).reshape(3, 2) + i) for i in range(N_LINES)], dtype=object
    )
    kinds = np.array(["guardrail", "cable"] * 3, dtype=object)
    pyogrio.raw.write(
        path, shapely.to_wkb(shapes), [kinds], ["kind"], geometry_type="LineString", crs="EPSG:25832", driver="GPKG",
        layer="roads",
    )  # fmt: skip
    return [*_lines_as(".gpkg")(folder), path]


def _read_lines(path: Path) -> Outcome:
    from linework.files.vectors.read_write import read_lines

    target = path.with_suffix(".shp") if path.suffix in (".shx", ".dbf", ".prj", ".cpg") else path
    lines = read_lines(target)
    if not np.isfinite(lines.xyz[:, :2]).all():
        return "SILENT LOSS", "coordinates that are not finite"
    promised = _features(path) if path.suffix == ".geojson" else None if path.suffix == ".dxf" else N_LINES
    n = len(lines)
    return ("fewer" if promised is not None and n < promised else "read"), f"{n} of {promised}"


def _features(path: Path) -> int:
    """Return the lines of a GeoJSON by another reader; parts of several count once."""
    document = json.loads(path.read_bytes())
    found = document.get("features", []) if isinstance(document, dict) else []
    shapes = [one.get("geometry") or {} for one in found if isinstance(one, dict)]
    return sum(1 for shape in shapes if isinstance(shape, dict) and shape.get("type") == "LineString")


def _poses(folder: Path) -> list[Path]:
    from linework.files.trajectories.read import write_trajectory
    from linework.model.trajectory import Trajectory

    time = np.arange(N_POSES) / 10.0 + 401_000_000.0
    xyz = np.stack(
        [500_000.0 + time - time[0], np.full(N_POSES, 5_400_000.0), np.full(N_POSES, 100.0)], axis=1
    )
    write_trajectory(Trajectory(time, xyz, np.tile([0.0, 0.0, 90.0], (N_POSES, 1))), folder / "path.csv")
    rows = [f"{t:.3f} {x:.3f} 2.0 3.0 0 0 0 1" for t, x in zip(time, xyz[:, 0], strict=True)]
    (folder / "path.tum").write_text("\n".join(rows) + "\n")
    return [folder / "path.csv", folder / "path.tum"]


def _sbet(folder: Path) -> list[Path]:
    time = np.arange(N_POSES) / 10.0 + 200_000.0
    rows = np.zeros((N_POSES, 8))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = time, 0.8, 0.16 + time * 1e-8 - 0.002, 250.0
    gnss_files.sbet(rows, folder / "path.sbet")
    return [folder / "path.sbet"]


def _nmea(folder: Path) -> list[Path]:
    lines = [gnss_files.rmc("120000.00", "280524")]
    for i in range(N_POSES):
        clock = f"1200{i // 2:02d}.{5 * (i % 2)}0"
        lines += [gnss_files.gga(clock, 46.0, 9.0 + 1e-6 * i, 250.0), gnss_files.gst(clock, 0.02, 0.03, 0.05)]
    (folder / "gnss.nmea").write_text("\r\n".join(lines) + "\r\n")
    return [folder / "gnss.nmea"]


def _read_poses(path: Path) -> Outcome:
    from linework.crs import parse_crs
    from linework.files.geodetic import EarthFrame
    from linework.files.trajectories.read import TrajectorySettings, read_trajectory_content

    content = read_trajectory_content(path, TrajectorySettings(frame=EarthFrame(crs=parse_crs("EPSG:25832"))))
    found = content.trajectory
    if not (np.isfinite(found.xyz).all() and np.isfinite(found.time_s).all()):
        return "SILENT LOSS", "poses that are not finite"
    n_bytes = path.stat().st_size
    promised = -(-n_bytes // 136) if path.suffix == ".sbet" else _rows_of(path)
    said = " | ".join(content.warnings)
    if len(found.time_s) < promised and path.suffix != ".nmea":
        return "fewer", f"{len(found.time_s)} of {promised} | {said}".rstrip(" |")
    return "read", said


def _rows_of(path: Path) -> int:
    """Return the lines of a table that are not empty, its header apart."""
    lines = [
        line for line in path.read_bytes().splitlines() if line.strip() and not line.lstrip().startswith(b"#")
    ]
    return max(len(lines) - int(path.suffix == ".csv"), 0)


def _logs(folder: Path) -> list[Path]:
    from linework.simulation.folder import write_logs
    from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, simulate_logs
    from linework.simulation.sensors.long_drives import URBAN, long_drive

    rng = np.random.default_rng(4)
    drive = long_drive(URBAN, 8.0, rng)
    logs = simulate_logs(
        drive, SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[1]), rng, origin_m=(500_000.0, 5_400_000.0, 100.0)
    )
    text = 'name = "drive"\ncrs = "EPSG:25832+7837"\n' + write_logs(logs, folder)
    (folder / "survey.toml").write_text(text)
    return [folder / name for name in ("gnss.csv", "gyro.csv", "wheels.csv")]


def _read_logs(path: Path) -> Outcome:
    from linework.files.logs.sensors import read_navigation_logs
    from linework.files.survey.open import open_survey

    content = read_navigation_logs(open_survey(path.parent))
    read = {"gnss.csv": content.logs.gnss, "gyro.csv": content.logs.gyro, "wheels.csv": content.logs.wheels}[
        path.name
    ]
    n, promised = 0 if read is None else len(read.time_s), _rows_of(path)
    said = " | ".join(content.warnings)
    return ("fewer", f"{n} of {promised} | {said}".rstrip(" |")) if n < promised else ("read", said)


def _photolog(folder: Path) -> list[Path]:
    stereo_folder(folder, [0.1 * i for i in range(8)])
    rows = "".join(f"{i / 10},m,manhole {i}\n" for i in range(20))
    (folder / "events.csv").write_text("time_s,key,note\n" + rows)
    return [folder / "events.csv", folder / "left.csv"]


def _read_photolog(path: Path) -> Outcome:
    from linework.files.images.lists import read_image_list
    from linework.files.logs.keys import read_events

    if path.name == "events.csv":
        events = read_events(path)
        n, warned = len(events.time_s), events.warnings
    else:
        images = read_image_list({"images": path.name}, path.parent, "cameras.left")
        n, warned = len(images.files), images.warnings
    promised = _rows_of(path)
    return (
        ("fewer", f"{n} of {promised} | {' | '.join(warned)}".rstrip(" |")) if n < promised else ("read", "")
    )


def _settings(folder: Path) -> list[Path]:
    from linework.model.settings import settings_toml
    from linework.runs.settings import RunSettings

    tables = [
        f"[{f.name}]\n{settings_toml(getattr(RunSettings(), f.name), f'{f.name}.')}"
        for f in fields(RunSettings)
    ]
    (folder / "run.toml").write_text("".join(tables))
    stereo_folder(folder, [0.1 * i for i in range(8)], more='[time]\nepoch = "gps"\n')
    return [folder / "run.toml", folder / "survey.toml"]


def _read_settings(path: Path) -> Outcome:
    from linework.files.images.series import open_stereo
    from linework.files.settings_file import read_settings_file
    from linework.files.survey.open import open_survey
    from linework.runs.settings import RunSettings

    if path.name == "run.toml":
        read_settings_file(RunSettings, path)
    else:
        open_stereo(open_survey(path.parent))
    return "read", ""


def _image(kind: str, suffix: str) -> Callable[[Path], list[Path]]:
    def make(folder: Path) -> list[Path]:
        picture(3).save(folder / f"grey{suffix}", format=kind)
        picture(4).convert("RGB").save(folder / f"colour{suffix}", format=kind)
        return [folder / f"grey{suffix}", folder / f"colour{suffix}"]

    return make


def _read_image(path: Path) -> Outcome:
    from linework.files.images.read import image_size, read_image
    from linework.files.images.screen import image_thumbnail
    from linework.model.camera import Camera

    values = read_image(path, Camera(width=WIDTH, height=HEIGHT, fx=5.0, fy=5.0, cx=31.5, cy=23.5))
    if values.shape != (HEIGHT, WIDTH) or image_size(path) != (WIDTH, HEIGHT):
        return "SILENT LOSS", f"{values.shape}"
    image_thumbnail(path)
    return "read", ""


def _calibration(folder: Path) -> list[Path]:
    from tests.scenes.kitti_folders import write_sequence

    write_sequence(folder)
    return [folder / "calib.txt", *folder.glob("times.txt"), *folder.glob("poses.txt")]


def _read_calibration(path: Path) -> Outcome:
    from linework.files.images.series import open_stereo
    from linework.files.survey.open import open_survey

    open_stereo(open_survey(path.parent))
    return "read", ""


#: Formats that are not laser files, by name.
OTHERS = {
    "GeoPackage": Format(_foreign_geopackage, damaged_geopackage, _read_lines),
    "GeoJSON": Format(_lines_as(".geojson"), damaged_text, _read_lines),
    "DXF": Format(_lines_as(".dxf"), damaged_text, _read_lines),
    "FlatGeobuf": Format(_lines_as(".fgb"), damaged_bytes, _read_lines),
    "Shapefile": Format(_shapefiles, damaged_bytes, _read_lines),
    "CSV of logs": Format(_logs, damaged_text, _read_logs),
    "CSV of photologs": Format(_photolog, damaged_text, _read_photolog),
    "CSV and TUM of poses": Format(_poses, damaged_text, _read_poses),
    "NMEA": Format(_nmea, damaged_text, _read_poses),
    "SBET": Format(_sbet, damaged_bytes, _read_poses),
    "TOML": Format(_settings, damaged_text, _read_settings),
    "KITTI calibration": Format(_calibration, damaged_text, _read_calibration),
    "PNG": Format(_image("PNG", ".png"), damaged_bytes, _read_image),
    "JPEG": Format(_image("JPEG", ".jpg"), damaged_bytes, _read_image),
    "TIFF": Format(_image("TIFF", ".tif"), damaged_bytes, _read_image),
}
LASER = "LAS, LAZ, COPC"
NAMES = (LASER, *OTHERS)


class Formats:
    """Sound files of all formats in a folder, and what reads damaged ones.

    Parameters
    ----------
    folder
        For files; a format is made when it is first asked for.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._sound: dict[str, list[tuple[str, bytes]]] = {}
        self._laser: dict[str, bytes] = {}
        self._reader: LaserReader | None = None
        self._kept = ExitStack()

    def __enter__(self) -> Formats:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._kept.close()

    def damaged(self, name: str, seed: int) -> tuple[Path, str]:
        """Return a damaged file of a format, and what was done to it."""
        if name == LASER:
            self._laser = self._laser or laser_bases(self.folder / "laser")
            base, done, data = damaged_laser(seed, self._laser)
            path = self.folder / f"mutant{Path(base).suffix}"
            path.write_bytes(data)
            return path, f"{base}: {done}"
        sound = self._of(name)
        rng = np.random.default_rng([seed, 29])
        index = int(rng.integers(len(sound)))
        base, data = sound[index]
        done, data = OTHERS[name].damage(rng, data)
        folder = self._place(name) / "now"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self._place(name) / "sound", folder)
        (folder / base).write_bytes(data)
        return folder / base, f"{base}: {done}"

    def read(self, name: str, path: Path) -> Outcome:
        """Return what reading a file came to; errors as commands raise them."""
        if name == LASER:
            if self._reader is None:
                self._reader = self._kept.enter_context(LaserReader(self.folder))
            return laser_outcome(self._reader, path)
        return OTHERS[name].read(path)

    def _place(self, name: str) -> Path:
        return self.folder / "".join(c for c in name if c.isalnum())

    def _of(self, name: str) -> list[tuple[str, bytes]]:
        """Return names and bytes of the sound files of a format."""
        if name not in self._sound:
            folder = self._place(name) / "sound"
            folder.mkdir(parents=True)
            paths = OTHERS[name].make(folder)
            self._sound[name] = [(path.relative_to(folder).as_posix(), path.read_bytes()) for path in paths]
        return self._sound[name]
