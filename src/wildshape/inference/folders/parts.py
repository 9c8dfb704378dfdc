# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks in parts that are completed at once, each by whoever is free, and written.

A part is as many scans as the network takes at once: results do not depend on who works on what.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from wildshape.inference.predictor import BATCH, Predictor
from wildshape.io.output import file_name
from wildshape.io.progress import Bar
from wildshape.io.scans.writers import CloudFormat, MeshFiles, write_cloud, write_mesh
from wildshape.records import Completion, Points, Track

COMPLETED, MESH = "completed", "mesh"


@dataclass(frozen=True)
class Part:
    """Some scans of a track.

    Attributes:
        index: of the track in its input.
        track: with these scans alone, and without its shape.
        first: of these scans in the track.
        count: of the track's scans.
    """

    index: int
    track: Track
    first: int
    count: int

    def __str__(self) -> str:
        return f"{self.track.name}, scan {self.first + 1}"

    @property
    def end(self) -> int:
        """After the last of these scans in the track."""
        return self.first + len(self.track.scan_names)


Done = tuple[Part, list[Completion]]
"""A part and its completions, both without points."""


def parts_of(tracks: Iterable[tuple[int, Track]], *, together: bool) -> Iterator[Part]:
    """Tracks with their indices, cut into parts; whole where their scans are used together."""
    for index, track in tracks:
        count = len(track.scans)
        size = count if together else BATCH
        for first in range(0, count, size):
            rows = list(range(first, min(first + size, count)))
            yield Part(index, replace(track.part(rows), shape=None), first, count)


def whole_tracks(parts: Iterable[Done], bar: Bar) -> Iterator[tuple[Track, list[Completion]]]:
    """The tracks, put together again from parts in order; `bar` is told how many are done."""
    names: list[str] = []
    found: list[Completion] = []
    for part, done in parts:
        names += part.track.scan_names
        found += done
        if part.end < part.count:
            bar.at(part.index, f"{part.track.name}, scan {part.end} of {part.count}")
            continue
        yield replace(part.track, scan_names=tuple(names)), found
        bar.at(part.index + 1, part.track.name)
        names, found = [], []


@dataclass(frozen=True)
class PartCompleter:
    """Completes a part and writes its shapes and meshes.

    Attributes:
        predictor: does the work.
        out: a folder of each track is written there.
        together: use all scans of a track together.
        clouds: format of the shapes; None: write none.
        mesh: also write a closed mesh of each shape, in this way.
    """

    predictor: Predictor
    out: Path
    together: bool
    clouds: CloudFormat | None
    mesh: MeshFiles | None

    def __call__(self, part: Part) -> Done:
        """Complete and write the scans of a part."""
        track = part.track
        done = self.predictor.complete_checked(
            track.scans, track.sensor, track=self.together, rays=track.rays
        )
        bare = []
        for name, scan, one in zip(track.scan_names, track.scans, done):
            self._write(self.out / file_name(track.name), file_name(name), scan, one)
            bare.append(replace(one, points=one.points[:0].copy()))
        return replace(part, track=replace(track, scans=(), rays=())), bare

    def _write(self, folder: Path, name: str, scan: Points, done: Completion) -> None:
        if self.clouds is not None:
            write_cloud(folder / COMPLETED / f"{name}.{self.clouds}", done.points)
        if self.mesh is not None:
            seen = scan if self.mesh.coloured else None
            write_mesh(folder / MESH / f"{name}.{self.mesh.kind}", done.mesh(seen))
