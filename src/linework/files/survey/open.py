"""Open a survey: laser files, a folder of them, a folder with a survey.toml, or a KITTI folder."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import pyproj

from linework.crs import LOCAL, crs_text, describe_crs, has_height, parse_crs, same_crs, same_plan
from linework.errors import CrsError, InputError, UsageError, argument
from linework.files.clouds.table import CLOUD_SUFFIXES
from linework.files.input import is_address, matching_paths, regular_file_bytes
from linework.files.las.crs import resolve_crs
from linework.files.las.header import read_las_header
from linework.files.output.inputs import note_inputs
from linework.files.outside import check_files_inside, check_names_inside
from linework.files.remote.address import check_address, is_remote, remote_names
from linework.files.survey.kitti import read_kitti_folder
from linework.files.survey.own_files import files_of_survey
from linework.model.survey import Survey

#: Formats of points. In a folder the first of them that is there is read.
_LASER = (".las", ".laz")
_SUFFIXES = (*_LASER, *CLOUD_SUFFIXES)
_SURVEY_FILE = "survey.toml"
#: Images of cameras, in a folder that is nothing else.
_IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm")
_SRC_ADVICE = "name .las/.laz files or a survey folder"


#: What a survey is named by: a file, a folder, a pattern such as ``"points/*.laz"``, or several of them.
SurveyPaths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]


def open_survey(
    src: SurveyPaths,
    *,
    crs: str | int | pyproj.CRS | None = None,
    carry: str | Iterable[str] = (),
    allow_outside: bool = False,
    allow_remote: bool = False,
) -> Survey:
    """Find the files and metadata of a survey; headers are read, points are not.

    Parameters
    ----------
    src
        A .las, .laz, .copc.laz, .ply, .pcd or .e57 file, a folder of them (of laser files only, if there are any), a pattern such as ``"points/*.laz"``, or several of these;
        one folder with a survey.toml, or that file; one KITTI raw drive or odometry sequence. A LAS or LAZ file may be
        at an address: ``"https://..."``, ``"http://..."`` or ``"s3://bucket/name"``.
    crs
        CRS where the files do not state it: "EPSG:...", an EPSG code, a `pyproj.CRS`, WKT or "local".
    carry
        Names of further columns that the points are to have: extra dimensions of the laser files, or
        classification, return_number, number_of_returns, user_data, point_source_id, scan_angle [deg],
        scanner_channel, scan_direction_flag, edge_of_flight_line, red, green, blue.
    allow_outside
        Whether a survey.toml may name files outside its folder: absolute paths, ``..``, links that end elsewhere.
    allow_remote
        Whether a survey.toml may name points at addresses.

    Returns
    -------
    Survey
        Files sorted by path, each once. ``settings["crs"]`` is what the user or the survey.toml gave;
        `crs` is the metric CRS that the points will be in.

    Raises
    ------
    InputError
        No files, not a local file, a pattern that matches none, or all files damaged.
    CrsError
        No CRS, one in degrees, or several.
    ConfigError
        An unknown key, a wrong value, a file outside the folder or an address in the survey.toml.
    MissingPackageError
        Points are at an address, and the extra that reads them is not installed.
    MachineError
        The server of an address cannot be reached, or fails.
    UsageError
        A file of the survey is an output that is being written.
    """
    names = _further_names(carry)
    inputs = survey_paths(src)
    given_text = None if crs is None else crs_text(crs)
    found = _survey_file_of(inputs)
    is_folder = found is None and len(inputs) == 1 and not is_remote(inputs[0])
    kitti = read_kitti_folder(inputs[0]) if is_folder else None
    warnings = kitti.warnings if kitti else ()
    if found is not None:
        from linework.files.survey.toml import read_survey_file

        settings, root = read_survey_file(found), found.parent
        if not allow_outside:
            check_names_inside(settings, found)
        patterns = settings.get("points", {}).get("files", [])
        remote = remote_names(patterns, found, allow_remote=allow_remote)
        files = _each_once(_matching(root, [p for p in patterns if not is_remote(Path(p))], found))
        if not allow_outside:
            check_files_inside(files, "points.files", found)
        files = _each_once([*files, *remote])
    elif kitti is not None:
        settings, root, files = {"crs": given_text or LOCAL, **kitti.settings}, inputs[0], ()
    else:
        settings = {}
        root = root_of(inputs)
        files = _each_once([file for path in inputs for file in _files_of(path)])
        warnings = tuple(text for path in inputs if path.is_dir() for text in _left_below(path))
    given, given_by = _given_crs(given_text, settings.get("crs"), found)
    if given is not None:
        settings = {**settings, "crs": given}
    trajectory = settings.get("trajectory", {})
    lever_x, lever_y, lever_z = (float(v) for v in trajectory.get("lever_m", (0.0, 0.0, 0.0)))
    roll, pitch, heading = (float(v) for v in trajectory.get("boresight_deg", (0.0, 0.0, 0.0)))
    survey = Survey(
        name=settings.get("name") or (root.resolve().name if inputs[0].is_dir() or found else files[0].stem),
        root=root,
        point_files=files,
        crs=_survey_crs(files, given, given_by, has_images="cameras" in settings),
        trajectory_file=root / trajectory["file"] if "file" in trajectory else None,
        trajectory_lever_m=(lever_x, lever_y, lever_z),
        trajectory_boresight_deg=(roll, pitch, heading),
        settings=settings,
        settings_file=kitti.calibration if kitti else found,
        warnings=warnings,
        carry=names,
        allow_outside=allow_outside or kitti is not None,
    )
    note_inputs(files_of_survey(survey))
    return survey


#: Columns that points have in any case, under the names of LAS and of `linework.model.points.Points`.
_ALWAYS = frozenset({"x", "y", "z", "xyz", "intensity", "gps_time", "time_s", "crs", "columns"})


def _further_names(carry: str | Iterable[str]) -> tuple[str, ...]:
    """Return the names of further columns, sorted, each once."""
    names = tuple(sorted({carry} if isinstance(carry, str) else set(carry)))
    for name in names:
        if name in _ALWAYS:
            raise UsageError(f"'{name}' is read in any case", where=argument("carry"), advice="leave it out")
    return names


def survey_paths(src: SurveyPaths) -> list[Path]:
    """Return the files and folders that a survey is named by; patterns are replaced by what they match.

    Parameters
    ----------
    src
        As `open_survey` takes it. What exists under its name is never read as a pattern.

    Raises
    ------
    UsageError
        Nothing is named, or something that is not a path.
    InputError
        A pattern matches no laser file and no folder, or an address is named.

    Examples
    --------
    >>> [path.name for path in survey_paths(["north/a.laz", Path("b.laz")])]
    ['a.laz', 'b.laz']
    """
    listed = [src] if isinstance(src, str | os.PathLike) or not isinstance(src, Iterable) else list(src)
    wrong = [one for one in listed if not isinstance(one, str | os.PathLike)]
    if wrong:
        raise UsageError(f"{wrong[0]!r:.60} is not a path", where=argument("src"), advice=_SRC_ADVICE)
    if not any(os.fspath(one) for one in listed):
        raise UsageError("no survey given", advice=_SRC_ADVICE)
    paths = [Path(one) for one in listed]
    for path in paths:
        _check_local(path)
    return [matched for path in paths for matched in _matches(path)]


def root_of(inputs: Sequence[Path]) -> Path:
    """Return the folder of a survey: the first one named, or that of the first file here; the present one without."""
    here = next((path for path in inputs if not is_remote(path)), Path())
    return here if here.is_dir() else here.parent


def _matches(path: Path) -> list[Path]:
    """Return the laser files that a pattern matches, or else the folders; any other path as it is."""
    if is_remote(path) or not set("*?[").intersection(str(path)) or os.path.lexists(path):
        return [path]
    matched = [found for found in _found(Path(), str(path)) if not found.name.startswith(".")]
    files = [found for found in matched if found.suffix.lower() in _SUFFIXES and not found.is_dir()]
    found = files or [found for found in matched if found.is_dir()]
    if not found:
        raise InputError("the pattern matches no file of points and no folder", where=path,
                         advice="check the folder and the pattern")  # fmt: skip
    return found


def _found(root: Path, pattern: str) -> list[Path]:
    """Return what matches a pattern that starts from a folder, sorted."""
    # Joining drops the root where the pattern is an absolute path
    place = root / pattern
    base = Path(place.anchor) if place.is_absolute() else Path()
    return matching_paths(base, str(place.relative_to(base)))


def _check_local(path: Path) -> None:
    """Refuse what is neither a file on this machine nor an address that points are read from."""
    if is_remote(path):
        check_address(path)
    elif is_address(path):
        raise InputError("is not a file on this machine", where=path, advice="copy it here first")


def _survey_file_of(inputs: Sequence[Path]) -> Path | None:
    """Return the survey.toml among the inputs, which must be the only one; None without one."""
    found = [p / _SURVEY_FILE if p.is_dir() else p for p in inputs]
    found = [p for p in found if p.name.endswith(".toml") and p.is_file()]
    if found and len(inputs) > 1:
        raise UsageError(f"a survey.toml and {len(inputs) - 1} other inputs", where=found[0],
                         advice="name the survey folder alone")  # fmt: skip
    return found[0] if found else None


def _files_of(path: Path) -> list[Path]:
    """Return the laser files of an input: itself, or those of a folder."""
    if is_remote(path):
        return [path]
    if path.is_dir():
        # Hidden files are left by other systems beside a file (._a.laz), or are being written
        files = sorted(
            p
            for p in path.iterdir()
            if p.suffix.lower() in _SUFFIXES and not p.name.startswith(".") and not p.is_dir()
        )
        if not files:
            _refuse_images_alone(path)
            raise InputError(f"folder without points ({', '.join(_SUFFIXES)}) and without survey.toml", where=path,
                             advice="name the folder that holds them, or a KITTI folder")  # fmt: skip
        # Clouds beside laser files are as often made from these
        laser = [p for p in files if p.suffix.lower() in _LASER]
        return laser or files
    regular_file_bytes(path)
    if path.suffix.lower() not in _SUFFIXES:
        raise InputError(f"suffix '{path.suffix}', expected {', '.join(_SUFFIXES)} or survey.toml", where=path,
                         advice="convert it to .laz")  # fmt: skip
    return [path]


def _refuse_images_alone(folder: Path) -> None:
    """Raise, for a folder of left and right images, what is missing to make it a survey."""
    images = [p for p in _listed(folder) if p.suffix.lower() in _IMAGES and not p.name.startswith(".")]
    n_left, n_right = (sum(p.name.lower().startswith(side) for p in images) for side in ("left", "right"))
    if not n_left or not n_right:
        return
    calibration = (folder / "calib.txt").is_file()
    missing = ["the times of the images", "the path of the vehicle"]
    missing += ["where the cameras are in it"] if calibration else ["a calibration"]
    also = " and calib.txt" if calibration else ""
    raise InputError(
        f"{n_left} left and {n_right} right images{also}, but no {_SURVEY_FILE}: {', '.join(missing)} are missing",
        where=folder,
        advice=f"write a {_SURVEY_FILE} with [cameras.left], [cameras.right] and [trajectory] or [navigation]",
    )  # fmt: skip


def _left_below(folder: Path) -> list[str]:
    """Return warnings about points in a folder that are not read: in folders in it, and in other formats beside laser files."""
    below = [p for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".") and not p.is_symlink()]
    n = {p.name: sum(file.suffix.lower() in _SUFFIXES for file in _listed(p)) for p in sorted(below)}
    named = ", ".join(name for name, count in n.items() if count)
    here = [p.suffix.lower() for p in _listed(folder) if not p.name.startswith(".") and p.is_file()]
    others = [suffix for suffix in here if suffix in CLOUD_SUFFIXES]
    found = []
    if others and any(suffix in _LASER for suffix in here):
        found = [
            f"{folder}: {len(others)} files of other formats ({', '.join(sorted(set(others)))}) are not read, since there"
            " are laser files; name them to read them, too"
        ]
    if not named:
        return found
    return [
        *found,
        f"{folder}: {sum(n.values())} laser files in folders below it are not read ({named}); name those folders too",
    ]


def _listed(folder: Path) -> list[Path]:
    """Return what is in a folder; nothing where it cannot be read."""
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _matching(root: Path, patterns: Sequence[str], where: Path) -> list[Path]:
    """Return the files that match the patterns of a survey.toml."""
    files = []
    for pattern in patterns:
        matched = [path for path in _found(root, pattern) if not path.is_dir()]
        if not matched:
            raise InputError(f"points.files: '{pattern}' matches no file", where=where,
                             advice="patterns start from the folder of the survey.toml")  # fmt: skip
        files += matched
    return files


def _each_once(files: Sequence[Path]) -> tuple[Path, ...]:
    """Return the files sorted, links to the same file once; unreadable ones are reported when they are read."""
    kept: dict[object, Path] = {}
    for path in sorted(files):
        try:
            status = path.stat()
        except OSError:
            kept[path] = path
        else:
            kept.setdefault((status.st_dev, status.st_ino), path)
    return tuple(kept.values())


def _given_crs(option: str | None, setting: str | None, where: Path | None) -> tuple[str | None, str]:
    """Return the CRS that was given, and what gave it: the parameter, or the survey.toml; each is checked."""
    by_option = "" if option is None else parse_crs(option, where=argument("crs"))
    by_setting = "" if setting is None or where is None else parse_crs(setting, where=f"{where}: crs")
    if by_option and by_setting and not same_crs(by_option, by_setting):
        raise CrsError(f"two different CRSs: crs = {setting}, {argument('crs')} says {option}", where=where,
                       advice=f"leave {argument('crs')} out, or correct the survey.toml")  # fmt: skip
    if where is not None and option is None and by_setting:
        return setting, f"crs in {where.name}"
    return option or setting, argument("crs")


def _survey_crs(files: Sequence[Path], given: str | None, by: str, *, has_images: bool) -> str:
    """Return the CRS of the points; the given one without points, or where images need none."""
    try:
        return _common_crs(files, given, by) if files else parse_crs(given or LOCAL)
    except InputError:
        # All files are damaged, which is reported when they are read
        if not has_images or given is None:
            raise
        return parse_crs(given)


def _common_crs(files: Sequence[Path], given: str | None, by: str) -> str:
    """Return the common CRS of all readable files; with heights where some files lack them."""
    found: dict[Path, str] = {}
    first_error: InputError | None = None
    for path in files:
        try:
            header = read_las_header(path)
        except InputError as error:  # reported again when the points are read
            first_error = first_error or error
            continue
        found[path] = resolve_crs(header.projection, given, by=by, where=path).crs
    if not found:
        assert first_error is not None
        raise first_error
    full = next((crs for crs in found.values() if has_height(crs)), next(iter(found.values())))
    others = {
        path: crs
        for path, crs in found.items()
        if not same_plan(crs, full) or (has_height(crs) and not same_crs(crs, full))
    }
    if others:
        path, crs = next(iter(others.items()))
        first = next(p for p, c in found.items() if c == full)
        raise CrsError(
            f"{len(others)} of {len(found)} files have another CRS: {path.name} {describe_crs(crs)},"
            f" {first.name} {describe_crs(full)}",
            where=path,
            advice="transform them to one CRS, or extract them one by one",
        )
    return full
