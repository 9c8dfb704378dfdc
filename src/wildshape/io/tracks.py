# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track folders: scans/, and if known rays/, poses.txt, shape.ply, track.json (docs/formats.md)."""

import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np
import torch
from jaxtyping import Float32
from numpy import ndarray

from wildshape.arguments import as_path, expect
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import naming, write_json
from wildshape.io.guard import read_json
from wildshape.io.order import out_of_order
from wildshape.io.poses import read_poses, write_poses
from wildshape.io.rays import check_rays, read_rays, write_rays
from wildshape.io.scans.points import (
    METRES,
    SENSOR_METRES,
    Coordinates,
    checked,
    is_scan_file,
    read_points,
    read_scan,
)
from wildshape.io.scans.writers import ply_bytes, write_ply
from wildshape.io.sensor_json import sensor_from_json, sensor_to_json
from wildshape.records import ShapeKind, SightLines, Track, as_text

Skipped = tuple[tuple[str, str], ...]

_MOST_METRES = 1e3
_INFO = "track.json"


@dataclass(frozen=True)
class TrackFile:
    """A track as read.

    Attributes:
        track: the usable scans, with their truth if there is any.
        skipped: file name and reason of each scan that could not be used.
        dropped_nonfinite: file name and number of the points that `read_scan` dropped.
        doubts: what is odd about the names of scans and rays, a sentence by kind.
    """

    track: Track
    skipped: Skipped = ()
    dropped_nonfinite: tuple[tuple[str, int], ...] = ()
    doubts: dict[str, str] = field(default_factory=dict)


class NoUsableScanError(BadInputError):
    """A track all of whose scans were refused; `skipped` says why."""

    def __init__(self, folder: Path, skipped: Skipped):
        self.skipped = skipped
        reason = skipped[0][1] if skipped else "the folder is empty"
        super().__init__(f"{folder}: none of {len(skipped)} scans can be used; the first: {reason}")


def read_track(folder: Path | str, coordinates: Coordinates = SENSOR_METRES) -> Track:
    """The track in a folder; scans that cannot be used are left out (see `read_track_file`)."""
    return read_track_file(folder, coordinates).track


def read_track_file(
    folder: Path | str, coordinates: Coordinates = SENSOR_METRES, name: str | None = None
) -> TrackFile:
    """The track in a folder with the list of the scans that had to be skipped.

    Args:
        folder: holds scans/, and perhaps rays/, poses.txt, shape.ply, track.json.
        coordinates: the unit is that of scans, shape and the poses' translations; the "unit" of
            track.json goes before the default `m`. The origin is subtracted from scans and poses.
            Everything returned is in metres.
        name: of the track, if not the folder's.

    Raises:
        BadInputError: no scans, none of them usable, or damaged rays, poses, shape or track.json.
    """
    folder, coordinates = as_path(folder, "folder"), checked(coordinates)
    files = scan_files(folder / "scans")
    info = read_info(folder / _INFO)
    coordinates = coordinates.in_unit(info["unit"])
    kept, skipped, dropped = _read_scans(files, folder, coordinates)
    rows = [row for row, file in enumerate(files) if file in kept]
    poses = _read_truth(folder / "poses.txt", len(files), rows, coordinates)
    track = Track(
        name=name or folder_name(folder),
        scans=tuple(kept.values()),
        scan_names=_stems(list(kept)),
        sensor=info["sensor"],
        category=info["category"],
        source=info["source"],
        T_sensor_object=poses,
        shape=_read_shape(folder / "shape.ply", Coordinates(coordinates.unit)),
        rays=tuple(rays_beside(file, scan, coordinates) for file, scan in kept.items()),
        label_size_m=info["label_size_m"],
        shape_kind=info["shape_kind"],
    )
    doubts = _doubts_of(files) | _doubts_of_rays(folder / "rays", files)
    return TrackFile(track, skipped, dropped, doubts)


def track_of_files(
    files: list[Path], name: str, coordinates: Coordinates = SENSOR_METRES
) -> TrackFile:
    """Scan files of a plain folder as one track, in the order given.

    Raises:
        NoUsableScanError: none of them can be used.
    """
    kept, skipped, dropped = _read_scans(files, files[0].parent, coordinates)
    track = Track(name, tuple(kept.values()), _stems(list(kept)))
    return TrackFile(track, skipped, dropped, _doubts_of(files))


def _doubts_of(files: list[Path]) -> dict[str, str]:
    doubts = {}
    row = out_of_order([file.stem for file in files])
    if row is not None:
        doubts["order"] = (
            f"{files[row].name} is sorted before {files[row + 1].name}, for names are sorted as"
            " text; if they count time, write their numbers with leading zeros"
        )
    twice = next(((one, other) for one, other in pairwise(files) if one.stem == other.stem), None)
    if twice:
        doubts["formats"] = (
            f"{twice[0].name} and {twice[1].name} are taken for two scans; if they are one in two"
            " formats, remove one"
        )
    return doubts


def _doubts_of_rays(folder: Path, files: list[Path]) -> dict[str, str]:
    rays = {path.stem for path in folder.glob("*.npz")}
    if not rays or rays & {name for file in files for name in (file.stem, file.name)}:
        return {}
    told = f"rays/{min(rays)}.npz and all others there are not used; name them as the scans"
    return {"rays": told}


def folder_name(folder: Path) -> str:
    """What a folder is called: a link by its own name, `.` by that of the folder it is."""
    return folder.name if folder.name not in ("", "..") else folder.resolve().name


def scan_files(folder: Path) -> list[Path]:
    """The scan files of a folder, sorted by name: in time order.

    Raises:
        BadInputError: there is no such folder or no scan in it.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder}: no such folder; a track keeps its scans in scans/.")
    files = sorted((f for f in folder.iterdir() if is_scan_file(f)), key=lambda f: f.name)
    if not files:
        raise BadInputError(f"{folder}: holds no scan (.ply .pcd .bin .npy .npz .xyz .las ...).")
    return files


def _read_scans(
    files: list[Path], folder: Path, coordinates: Coordinates
) -> tuple[dict[Path, Float32[ndarray, "n 3"]], Skipped, tuple[tuple[str, int], ...]]:
    kept, skipped, dropped = {}, [], []
    for file in files:
        try:
            scan = read_scan(file, coordinates)
        except BadInputError as error:
            skipped.append((as_text(file.name), str(error)))
            continue
        kept[file] = scan.points
        if scan.dropped_nonfinite:
            dropped.append((file.name, scan.dropped_nonfinite))
    if not kept:
        raise NoUsableScanError(folder, tuple(skipped))
    return kept, tuple(skipped), tuple(dropped)


def _stems(files: list[Path]) -> tuple[str, ...]:
    """Names of scans: the stems, or the whole file names where two stems are equal."""
    stems = tuple(file.stem for file in files)
    return stems if len(set(stems)) == len(stems) else tuple(file.name for file in files)


def rays_beside(
    path: Path, scan: Float32[ndarray, "n 3"], coordinates: Coordinates
) -> SightLines | None:
    """The rays of a scan of a track folder, if it has any; they bear its name, or its file's.

    Raises:
        BadInputError: they are damaged, of another unit or of another scan.
    """
    folder = path.parent.parent / "rays"
    names = (f"{path.stem}.npz", f"{path.name}.npz")
    file = next((folder / name for name in names if (folder / name).is_file()), None)
    if file is None:
        return None
    rays = read_rays(file, coordinates)
    check_rays(rays, scan, str(file))
    return rays


def _read_truth(path: Path, count: int, kept: list[int], coordinates: Coordinates) -> SE3 | None:
    """Truth poses of the scans that were kept."""
    if not path.exists():
        return None
    poses = read_poses(path, count)[torch.tensor(kept)]
    moved = poses.translation - poses.translation.new_tensor(coordinates.origin)
    return SE3(poses.rotation, moved * METRES[coordinates.unit])


def _read_shape(path: Path, coordinates: Coordinates) -> Float32[ndarray, "n 3"] | None:
    if not path.exists():
        return None
    points = read_points(path, coordinates)
    if not len(points):
        raise BadInputError(f"{path}: holds no finite points; write it again, or remove it.")
    return points


def read_info(path: Path) -> dict[str, Any]:
    """track.json, its gaps filled.

    Raises:
        BadInputError: no JSON object, or a value that makes no sense.
    """
    expected = "JSON with the keys of a track"
    raw = read_json(path, expected, dict) if path.exists() else {}
    unit = raw.get("unit", "m")
    if unit not in tuple(METRES):
        raise BadInputError(f"{path}: unit {unit!r} is unknown; use one of {', '.join(METRES)}.")
    kind = raw.get("shape_kind", "whole")
    if kind not in get_args(ShapeKind):
        names = ", ".join(get_args(ShapeKind))
        raise BadInputError(f"{path}: shape_kind {kind!r} is unknown; use one of {names}.")
    return {
        "unit": unit,
        "sensor": sensor_from_json(raw, path),
        "category": str(raw.get("category") or ""),
        "source": str(raw.get("source") or ""),
        "label_size_m": _label_size(raw.get("label_size_m"), path),
        "shape_kind": kind,
    }


def _label_size(raw: object, path: Path) -> tuple[float, float, float] | None:
    if raw is None:
        return None
    with suppress(TypeError, ValueError):
        length, width, height = (float(side) for side in raw)  # pyright: ignore[reportGeneralTypeIssues]
        if all(0 < side < _MOST_METRES for side in (length, width, height)):
            return length, width, height
    raise BadInputError(
        f"{path}: label_size_m is {raw!r}, expected length, width and height in metres."
    )


def write_track(folder: Path | str, track: Track) -> None:
    """Write a track folder in metres; scans are numbered files if their names are no file names.

    Raises:
        BadInputError: the folder has scans already, or see `check_lengths` and `check_points`.
    """
    folder = as_path(folder, "folder")
    check_lengths(expect(track, Track, "track"))
    check_points(track)
    if (folder / "scans").exists():
        raise BadInputError(f"{folder}: holds a track already; choose another folder or remove it.")
    if track.T_sensor_object is not None:
        write_poses(folder / "poses.txt", track.T_sensor_object)
    if track.shape is not None:
        write_ply(folder / "shape.ply", track.shape)
    info: dict[str, Any] = {"category": track.category, "source": track.source, "unit": "m"}
    if track.label_size_m is not None:
        info["label_size_m"] = list(track.label_size_m)
    if track.shape_kind != "whole":
        info["shape_kind"] = track.shape_kind
    write_json(folder / _INFO, sensor_to_json(track.sensor) | info)
    for name, rays in zip(file_names(track.scan_names), track.rays):
        if rays is not None:
            write_rays(folder / "rays" / f"{name}.npz", rays)
    _write_scans(folder, track)


def check_lengths(track: Track) -> None:
    """Refuse a track of which scans would be lost, or read with the poses of others.

    Raises:
        BadInputError: no scans; names, rays or poses that are not one a scan.
    """
    poses, posed = track.T_sensor_object, "no"
    lengths = {len(track.scans), len(track.scan_names), len(track.rays or track.scans)}
    if poses is not None:
        batch = poses.translation.ndim == 2
        lengths.add(len(poses) if batch else 0)
        posed = str(len(poses)) if batch else "single"
    if len(lengths) > 1 or not track.scans:
        raise BadInputError(
            f"track {track.name}: {len(track.scans)} scans, {len(track.scan_names)} names, "
            f"{len(track.rays) or 'no'} rays and {posed} poses do not fit together."
        )


def check_points(track: Track) -> None:
    """Refuse scans or a shape that would be written as others.

    Raises:
        BadInputError: they are not `(n, 3)`.
    """
    clouds = track.scans if track.shape is None else (*track.scans, track.shape)
    if any(np.shape(cloud) != (len(cloud), 3) for cloud in clouds):
        raise BadInputError(f"track {track.name}: points are x, y, z; leave out what is more.")


def is_placed(folder: Path) -> bool:
    """Whether a track that `place_track` moved is whole."""
    return (folder / _INFO).is_file()


def place_track(made: Path, folder: Path) -> None:
    """Move a track folder to its name; files of others that lie there already stay.

    Beside these a track comes in pieces, and a move that was killed is repeated: scans/, which
    makes it a track, comes last but for track.json, and at once unless files of others lie there.
    """
    if not folder.exists():
        made.replace(folder)
        return
    for entry in sorted(
        made.iterdir(), key=lambda entry: (entry.name == _INFO, entry.name == "scans")
    ):
        if entry.is_dir():
            place_track(entry, folder / entry.name)
        else:
            entry.replace(folder / entry.name)


def _write_scans(folder: Path, track: Track) -> None:
    """All scans or none: they are written aside, and scans/ makes the folder a track, so last."""
    aside = folder / ".scans.part"
    shutil.rmtree(aside, ignore_errors=True)  # of a writer that was killed
    aside.mkdir()
    for name, points in zip(file_names(track.scan_names), track.scans):
        with naming(folder / "scans" / f"{name}.ply"):
            (aside / f"{name}.ply").write_bytes(ply_bytes(points))
    aside.replace(folder / "scans")


def file_names(scans: Sequence[str]) -> list[str]:
    """Names of a track's files that sort in time order: the scans' own if they do, else numbers."""
    files = [f"{name}.ply" for name in scans]  # `a-b.ply` is before `a.ply`
    usable = files == sorted(set(files)) and all(Path(n).name == n and n for n in scans)
    return list(scans) if usable else [f"{i:06d}" for i in range(len(scans))]
