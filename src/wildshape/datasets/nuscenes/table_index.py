# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What LIDAR_TOP needs of nuScenes' tables, in one SQLite file, by scene.

The tables of `trainval` are gigabytes of JSON that is sorted by nothing. They are read once, a
piece at a time; from then on a scene is a query, and no process holds a table.
"""

import hashlib
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from operator import itemgetter
from pathlib import Path
from typing import Any

from wildshape.datasets.nuscenes.json_rows import json_rows
from wildshape.errors import BadInputError, SharedInputError

CHANNELS = ("LIDAR_TOP", "LIDAR_CONCAT", "LIDAR_LEFT")
"""The LiDAR that is taken: nuScenes' and Lyft's, T4's, TruckScenes'; the first that there is."""
TABLES = (
    "category",
    "instance",
    "sensor",
    "calibrated_sensor",
    "scene",
    "sample",
    "sample_data",
    "ego_pose",
    "sample_annotation",
)
_VERSION = 3
_LATEST, _FARTHEST = 1 << 62, 1e8
_PATIENCE_S = 7200.0
_FILES = ("filename", "info_filename")
_UNSAID = {"info_filename": None}  # T4's alone
_POSE = "x REAL, y REAL, z REAL, qw REAL, qx REAL, qy REAL, qz REAL"
_SCHEMA = (
    "CREATE TABLE scene (id INTEGER PRIMARY KEY, name TEXT)",
    "CREATE TABLE instance (id INTEGER PRIMARY KEY, token TEXT, category TEXT)",
    f"CREATE TABLE calibration (id INTEGER PRIMARY KEY, {_POSE})",
    f"CREATE TABLE ego (id INTEGER PRIMARY KEY, {_POSE})",
    "CREATE TABLE frame (scene INTEGER, sample INTEGER, calibration INTEGER, ego INTEGER,"
    " is_key INTEGER, timestamp INTEGER, file TEXT, info TEXT)",
    "CREATE TABLE box (scene INTEGER, sample INTEGER, instance INTEGER, width REAL, length REAL,"
    f" height REAL, {_POSE})",
)
_SORTED = (
    "CREATE INDEX frame_scene ON frame (scene)",
    "CREATE INDEX box_scene ON box (scene)",
    "CREATE TABLE complete (version INTEGER)",
)
_Ids = dict[str, int]


def cache_folder() -> Path:
    """Where indexes are kept by default: the user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "wildshape"


@contextmanager
def index_of(tables: Path, cache: Path, channel: str) -> Iterator[sqlite3.Connection]:
    """The index of a table folder, built if there is none yet.

    The file's name holds the sizes and times of the tables, so that an old index is never taken
    for a new one. Whoever comes while it is built waits; a build that was killed leaves nothing.

    Raises:
        SharedInputError: a table is missing or damaged, or the index cannot be written or read.
    """
    path = cache / f"nuscenes-{_fingerprint(tables, channel)}.sqlite"
    with _whole(path, tables):
        cache.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(path, timeout=_PATIENCE_S, isolation_level=None)) as db:
            try:
                if not _is_complete(db):
                    _build_alone(db, tables, channel)
            except BadInputError as error:  # of json_rows
                raise SharedInputError(str(error)) from error
            yield db


@contextmanager
def _whole(path: Path, tables: Path) -> Iterator[None]:
    """All scenes need the index: what is wrong with its file is wrong for all of them."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise SharedInputError(
            f"{path}: this index of {tables} cannot be used ({error}); delete it, or set "
            "XDG_CACHE_HOME to a folder with space, and run again."
        ) from error


def lidar_of(tables: Path, wanted: str) -> str:
    """The channel of the LiDAR to take: the one wanted, or the first of `CHANNELS` that is there.

    Raises:
        SharedInputError: there is none.
    """
    there = {str(channel) for _, channel in _rows(tables, "sensor", "token", "channel")}
    found = next((c for c in ((wanted,) if wanted else CHANNELS) if c in there), None)
    if found is None:
        lidars = ", ".join(sorted(c for c in there if "LIDAR" in c)[:8]) or "no LiDAR"
        raise SharedInputError(
            f"{tables / 'sensor.json'}: no sensor {wanted or ' or '.join(CHANNELS)}, found "
            f"{lidars}; name one of them with --lidar."
        )
    return found


def _fingerprint(tables: Path, channel: str) -> str:
    known = [f"{_VERSION} {tables.resolve()} {channel}"]
    for path in map(tables.joinpath, (f"{name}.json" for name in TABLES)):
        if not path.is_file():
            raise SharedInputError(
                f"{path}: no such file; unpack nuScenes' metadata archive again."
            )
        known.append(f"{path.name} {path.stat().st_size} {path.stat().st_mtime_ns}")
    return hashlib.sha256("\n".join(known).encode()).hexdigest()[:16]


def _is_complete(db: sqlite3.Connection) -> bool:
    found = db.execute("SELECT 1 FROM sqlite_master WHERE name = 'complete'")
    return found.fetchone() is not None


def _build_alone(db: sqlite3.Connection, tables: Path, channel: str) -> None:
    """All in one transaction: others wait at its first line and then find the work done."""
    db.execute("PRAGMA cache_size = -65536")
    db.execute("PRAGMA temp_store = FILE")
    db.execute("BEGIN EXCLUSIVE")
    try:
        if not _is_complete(db):
            _build(db, tables, channel)
        db.execute("COMMIT")
    except BaseException:
        with suppress(sqlite3.Error):
            db.execute("ROLLBACK")
        raise


def _build(db: sqlite3.Connection, tables: Path, channel: str) -> None:
    for statement in _SCHEMA:
        db.execute(statement)
    scenes = _add_scenes(db, tables)
    samples = _read_samples(tables, scenes)
    egos = _add_frames(db, tables, samples, _add_calibrations(db, tables, channel))
    _add_egos(db, tables, egos)
    _add_boxes(db, tables, samples, _add_instances(db, tables))
    for statement in _SORTED:
        db.execute(statement)


def _add_scenes(db: sqlite3.Connection, tables: Path) -> _Ids:
    scenes: _Ids = {}
    for token, name in _rows(tables, "scene", "token", "name"):
        scenes[token] = len(scenes)
        db.execute("INSERT INTO scene VALUES (?, ?)", (scenes[token], name))
    return scenes


def _read_samples(tables: Path, scenes: _Ids) -> dict[str, tuple[int, int]]:
    """Scene and number of each sample."""
    rows = _rows(tables, "sample", "token", "scene_token")
    return {
        token: (_known(scenes, scene, tables, "sample", "scene"), number)
        for number, (token, scene) in enumerate(rows)
    }


def _add_instances(db: sqlite3.Connection, tables: Path) -> _Ids:
    categories = dict(_rows(tables, "category", "token", "name"))
    instances: _Ids = {}
    for token, category in _rows(tables, "instance", "token", "category_token"):
        name = _known(categories, category, tables, "instance", "category")
        instances[token] = len(instances)
        db.execute("INSERT INTO instance VALUES (?, ?, ?)", (instances[token], token, name))
    return instances


def _add_calibrations(db: sqlite3.Connection, tables: Path, wanted_channel: str) -> _Ids:
    """Those of the LiDAR; the other sensors' are left out here and everywhere."""
    channels = _rows(tables, "sensor", "token", "channel")
    lidar = {token for token, channel in channels if channel == wanted_channel}
    ids: _Ids = {}
    wanted = ("token", "sensor_token", "translation", "rotation")
    for token, sensor, *pose in _rows(tables, "calibrated_sensor", *wanted):
        if sensor in lidar:
            ids[token] = len(ids)
            numbers = _numbers(pose, 7, tables, "calibrated_sensor")
            db.execute(f"INSERT INTO calibration VALUES (?{',?' * 7})", (ids[token], *numbers))
    return ids


def _add_frames(
    db: sqlite3.Connection, tables: Path, samples: dict[str, tuple[int, int]], calibrations: _Ids
) -> _Ids:
    egos: _Ids = {}
    wanted = ("sample_token", "calibrated_sensor_token", "ego_pose_token")
    kept = ("is_key_frame", "timestamp", *_FILES)
    for sample, calibration, ego, *rest in _rows(tables, "sample_data", *wanted, *kept):
        if calibration not in calibrations:
            continue
        place = _known(samples, sample, tables, "sample_data", "sample")
        row = (*place, calibrations[calibration], egos.setdefault(ego, len(egos)), *rest)
        db.execute("INSERT INTO frame VALUES (?,?,?,?,?,?,?,?)", row)
    return egos


def _add_egos(db: sqlite3.Connection, tables: Path, egos: _Ids) -> None:
    for token, *pose in _rows(tables, "ego_pose", "token", "translation", "rotation"):
        number = egos.pop(token, None)
        if number is not None:
            numbers = _numbers(pose, 7, tables, "ego_pose")
            db.execute(f"INSERT INTO ego VALUES (?{',?' * 7})", (number, *numbers))
    if egos:
        _known({}, next(iter(egos)), tables, "sample_data", "ego_pose")


def _add_boxes(
    db: sqlite3.Connection, tables: Path, samples: dict[str, tuple[int, int]], instances: _Ids
) -> None:
    table = "sample_annotation"
    wanted = ("sample_token", "instance_token", "size", "translation", "rotation")
    for sample, instance, *box in _rows(tables, table, *wanted):
        place = _known(samples, sample, tables, table, "sample")
        number = _known(instances, instance, tables, table, "instance")
        row = (*place, number, *_numbers(box, 10, tables, table))
        db.execute(f"INSERT INTO box VALUES (?,?,?{',?' * 10})", row)


def _rows(tables: Path, name: str, *keys: str) -> Iterator[tuple[Any, ...]]:
    path = tables / f"{name}.json"
    values = itemgetter(*keys)
    for row in json_rows(path):
        try:
            found = values(_UNSAID | row)
        except KeyError as error:
            raise SharedInputError(
                f"{path}: a row has no {error}; unpack nuScenes' metadata archive again."
            ) from error
        for key, value in zip(keys, found, strict=True):
            if not _fits(key, value):
                raise SharedInputError(
                    f"{path}: {key} is {str(value)[:40]} in a row; unpack nuScenes' metadata "
                    "archive again."
                )
        yield found


def _fits(key: str, value: object) -> bool:
    """Whether a value is of its column's type; vectors are looked at by `_numbers`."""
    if key in ("translation", "rotation", "size"):
        return True
    if key == "is_key_frame":
        return isinstance(value, bool | int) and value in (0, 1)
    if key == "timestamp":
        return isinstance(value, int | float) and 0 <= value < _LATEST
    if key == "info_filename" and value in (None, ""):
        return True
    if not isinstance(value, str) or not value.isprintable():
        return False
    parts = value.split("/")
    longest = max(len(part.encode()) for part in parts)
    return key not in _FILES or (".." not in parts and parts[0] != "" and longest < 256)


def _known(ids: dict[str, Any], token: str, tables: Path, table: str, other: str) -> Any:
    if token not in ids:
        raise SharedInputError(
            f"{tables / f'{table}.json'}: names the {other} '{token}', which {other}.json does not "
            "have; take all tables from one release."
        )
    return ids[token]


def _numbers(vectors: list[Any], count: int, tables: Path, table: str) -> list[float]:
    try:
        numbers = [float(number) for vector in vectors for number in vector]
    except (TypeError, ValueError, OverflowError):
        numbers = []
    turn = sum(number * number for number in numbers[-4:])
    sound = all(abs(number) <= _FARTHEST for number in numbers) and 0.9 < turn < 1.1
    sound = sound and (count < 10 or min(numbers[:3], default=0.0) > 0)
    if len(numbers) != count or not sound:
        raise SharedInputError(
            f"{tables / f'{table}.json'}: expected {count} numbers in a row, found "
            f"{str(vectors)[:80]}; unpack nuScenes' metadata archive again."
        )
    return numbers
