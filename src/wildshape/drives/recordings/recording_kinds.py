# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which kind of recording lies at a path, and the drives in it.

To read another kind: a module with a function that finds its drives and one that opens a drive, and
a line in `_LAYOUTS`, where the first that finds a drive is taken: above `_FOLDER` if its scans lie
in the folder itself.
"""

from collections.abc import Callable
from itertools import compress
from pathlib import Path
from typing import NamedTuple

from wildshape.drives.recordings.argoverse2 import find_logs, open_log
from wildshape.drives.recordings.folders import (
    find_folders,
    find_kitti_raw,
    find_kitti_tracking,
    find_sequences,
    holds_scans,
    open_folder,
    open_kitti_raw,
    open_sequence,
)
from wildshape.drives.recordings.messages import (
    find_bag,
    find_packets,
    open_packet_file,
    open_recording,
)
from wildshape.drives.recordings.nuscenes import find_scenes, open_scene
from wildshape.drives.recordings.pandaset import find_pandaset, open_pandaset
from wildshape.drives.recordings.waymo import find_segments, open_segment
from wildshape.drives.source import Drive
from wildshape.errors import BadInputError

_MOST_NAMED = 8


class _Layout(NamedTuple):
    """How a kind of recording is found and read.

    Attributes:
        what: it is.
        find: the paths of its drives at or below a folder; none where it is of another kind. A
            drive that is no folder of its own has its name below the folder as its path.
        open: one of these.
    """

    what: str
    find: Callable[[Path], list[Path]]
    open: Callable[[Path], Drive]


_POSES = "its own poses are used in place of odometry, its labels are not"
_FOLDER = _Layout(
    "a folder of full scans", lambda path: [path] if holds_scans(path) else [], open_folder
)
_LAYOUTS = (
    _FOLDER,
    _Layout("packets of Velodyne or Ouster", find_packets, open_packet_file),
    _Layout(f"Argoverse 2: {_POSES}", find_logs, open_log),
    _Layout(f"PandaSet: {_POSES}", find_pandaset, open_pandaset),
    _Layout(f"the Waymo Open Dataset: {_POSES}", find_segments, open_segment),
    _Layout(f"nuScenes: {_POSES}", find_scenes, open_scene),
    _Layout("KITTI raw", find_kitti_raw, open_kitti_raw),
    _Layout("KITTI tracking", find_kitti_tracking, open_folder),
    _Layout("KITTI odometry or SemanticKITTI", find_sequences, open_sequence),
    _Layout("folders of full scans", find_folders, open_folder),
)
_BAG = "a recording of ROS"


class Found(NamedTuple):
    """The drives at a path.

    Attributes:
        what: kind of recording it was taken for.
        drives: the path of each, for `open_drive`.
    """

    what: str
    drives: list[Path]


def find_drives(path: Path) -> Found:
    """The drives of a folder or file, a data set's folder may hold many.

    Raises:
        BadInputError: a data set that lacks a file.
    """
    if find_bag(path):
        return Found(_BAG, [path])
    layout, drives = _layout(path)
    return Found(layout.what, drives)


def names_of(drives: list[Path]) -> list[str]:
    """The drives' names, before them those of folders above where it takes them to tell all apart.

    Raises:
        BadInputError: no number of folders tells them apart: one is given twice, say.
    """
    parts, names = [drive.resolve().parts for drive in drives], [""] * len(drives)
    for depth in range(1, 1 + min(map(len, parts))):
        ends = [own[-depth:] for own in parts]
        tells = [len(set(level)) > 1 for level in zip(*ends)]
        tells[-1] = True
        names = ["-".join(compress(own, tells)) for own in ends]
        if len(set(names)) == len(names):
            return names
    twice = next(drive for drive, name in zip(drives, names) if names.count(name) > 1)
    raise BadInputError(
        f"{twice}: another drive has the same name, or it is given twice; drop one."
    )


def open_drive(path: Path | str, topic: str | None = None) -> Drive:
    """A folder of full scans, a drive of a published data set, or a recording of ROS or of packets.

    Args:
        path: of the drive (docs/drive.md); one of several in a data set's folder has its name
            behind the folder's: `nuscenes/scene-0061`.
        topic: of point clouds, for a recording of ROS that holds several.

    Raises:
        BadInputError: no scans; times or poses of another number or not in order; no such topic.
        MissingExtraError: a library for the recording is not installed.
    """
    path = Path(path)
    if find_bag(path):
        return open_recording(path, topic)
    if topic is not None:
        raise BadInputError(f"{path}: has no topics, it is no recording of ROS; drop --topic.")
    layout, drives = _layout(path)
    if len(drives) > 1:
        names = ", ".join(drive.name for drive in drives[:_MOST_NAMED])
        more = ", ..." if len(drives) > _MOST_NAMED else ""
        raise BadInputError(
            f"{path}: holds {len(drives)} drives: {names}{more}; give one, such as {drives[0]}."
        )
    return layout.open(drives[0])


def _layout(path: Path) -> tuple[_Layout, list[Path]]:
    """The kind of a path and the drives in it."""
    for layout in _LAYOUTS:
        drives = layout.find(path)
        if drives:
            return layout, drives
    if not path.exists():
        for layout in _LAYOUTS:
            if path in layout.find(path.parent):
                return layout, [path]
    return _FOLDER, [path]
