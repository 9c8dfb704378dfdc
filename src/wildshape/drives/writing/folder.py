# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a drive's folder, by name. It imports little: `view` and `report` ask it first."""

from pathlib import Path

from wildshape.errors import BadInputError
from wildshape.io.output import MARKER

TRAJECTORY, TUM, FRAMES, BOXES = "trajectory.txt", "trajectory.tum", "frames.csv", "boxes.csv"
SHAPES, MESHES, MCAP, RRD = "shapes", "meshes", "drive.mcap", "drive.rrd"
TRACKS = "tracks"


def is_drive(out: Path) -> bool:
    """Whether a folder holds a finished drive.

    Raises:
        BadInputError: it holds several, a folder each.
    """
    if _finished(out):
        return True
    several = sorted(box.parent for box in out.glob(f"[!.]*/{BOXES}") if _finished(box.parent))
    if several:
        raise BadInputError(f"{out}: holds drives, a folder each; name one, such as {several[0]}.")
    return False


def _finished(out: Path) -> bool:
    return all((out / name).is_file() for name in (BOXES, FRAMES, MARKER))
