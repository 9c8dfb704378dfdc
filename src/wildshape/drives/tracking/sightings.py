# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An object of a drive: in which frames it was seen, as which cluster, with how many points."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from wildshape.drives.source import Drive
from wildshape.drives.tracking.segmentation import read_cut
from wildshape.io.atomic import write_json
from wildshape.io.guard import read_json, reading, record_of
from wildshape.records import Points, Track


@dataclass(frozen=True)
class Sightings:
    """Where one object is among the clusters of a drive.

    Attributes:
        frames: in which it was seen, rising.
        rows: of its clusters in each of them; fragments are several.
        points: of its clusters in each of them.
        parts: names of the tracks that were put together; none: it is one track.
    """

    name: str
    frames: tuple[int, ...]
    rows: tuple[tuple[int, ...], ...]
    points: tuple[int, ...]
    parts: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, name: str, frames: list[int], rows: list[int], counts: Sequence[Int[np.ndarray, "_"]]
    ) -> "Sightings":
        """An object that is one cluster in each frame; `counts`: of all clusters, by frame."""
        points = tuple(int(counts[frame][row]) for frame, row in zip(frames, rows))
        return cls(name, tuple(frames), tuple((row,) for row in rows), points)

    def part(self, kept: list[int]) -> "Sightings":
        """The same object in some of its frames, by place."""
        return Sightings(
            self.name,
            tuple(self.frames[i] for i in kept),
            tuple(self.rows[i] for i in kept),
            tuple(self.points[i] for i in kept),
            self.parts,
        )

    def clouds(self, cuts: Path) -> list[Points]:
        """Its points in each frame, sensor frame, metres."""
        found = []
        for frame, rows in zip(self.frames, self.rows):
            cut = read_cut(cuts, frame)
            found.append(np.concatenate([cut.cluster(row) for row in rows]))
        return found

    def seconds(self, cuts: Path) -> list[Float[np.ndarray, "_"]]:
        """When its points were met in each frame, since the scan's time; empty if not known."""
        found = []
        for frame, rows in zip(self.frames, self.rows):
            cut = read_cut(cuts, frame)
            found.append(np.concatenate([cut.seconds_of(row) for row in rows]))
        return found

    def track(self, cuts: Path, drive: Drive, category: str) -> Track:
        """Its scans."""
        names = tuple(drive.scan_names[frame] for frame in self.frames)
        source = f"{drive.name}: cut out by `wildshape drive`, {drive.cut_by}"
        return Track(self.name, tuple(self.clouds(cuts)), names, category=category, source=source)


def merged(parts: list[Sightings]) -> Sightings:
    """Several tracks as one object, named after the first and how many more: `0007+2`."""
    rows: dict[int, tuple[int, ...]] = {}
    points: dict[int, int] = {}
    for part in parts:
        for frame, own, count in zip(part.frames, part.rows, part.points):
            rows[frame] = (*rows.get(frame, ()), *own)
            points[frame] = points.get(frame, 0) + count
    frames = tuple(sorted(rows))
    return Sightings(
        f"{parts[0].name}+{len(parts) - 1}",
        frames,
        tuple(rows[frame] for frame in frames),
        tuple(points[frame] for frame in frames),
        tuple(part.name for part in parts),
    )


def write_sightings(path: Path, objects: list[Sightings]) -> None:
    """Write all objects as one JSON file, atomically."""
    write_json(path, [asdict(one) for one in objects])


def read_sightings(path: Path) -> list[Sightings]:
    """What `write_sightings` wrote.

    Raises:
        BadInputError: missing or damaged.
    """
    with reading(path, "the objects of a drive"):
        return [record_of(Sightings, one, {}) for one in read_json(path, "the objects", list)]
