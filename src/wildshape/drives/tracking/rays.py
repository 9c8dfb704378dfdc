# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The rays beside the objects of a drive, cut out of its whole scans."""

from collections.abc import Sequence
from pathlib import Path

from wildshape.drives.frame_cache import FrameCache
from wildshape.drives.source import Drive
from wildshape.drives.tracking.segmentation import read_cut
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.projection.full_scan import sight_lines
from wildshape.geometry.projection.sight_lines import SightLines


class RayCutter:
    """Cuts rays out of the scans of a drive."""

    def __init__(self, drive: Drive, cuts: Path) -> None:
        """`cuts`: folder of the drive's clusters."""
        self.drive, self.cuts = drive, cuts
        self._scans = FrameCache(drive.full_scan)

    def in_frame(self, frame: int, objects: Sequence[tuple[int, ...]]) -> list[SightLines | None]:
        """Those beside each of some objects, sensor frame; None for all if the scan is not read."""
        full, cut = self._scans(frame), read_cut(self.cuts, frame)
        if len(full.points) != cut.scanned:
            return [None] * len(objects)
        return [sight_lines(full, cut.rows_of(clusters)) for clusters in objects]

    def of(self, asked: Sequence[tuple[Sightings, int]]) -> list[SightLines | None]:
        """Those beside objects, each in one of its frames, by place; scans held come first."""
        by_frame: dict[int, list[int]] = {}
        for number, (seen, place) in enumerate(asked):
            by_frame.setdefault(seen.frames[place], []).append(number)
        found: list[SightLines | None] = [None] * len(asked)
        for frame in sorted(by_frame, key=lambda frame: (frame not in self._scans, frame)):
            numbers = by_frame[frame]
            objects = [asked[number][0].rows[asked[number][1]] for number in numbers]
            for number, rays in zip(numbers, self.in_frame(frame, objects)):
                found[number] = rays
        return found
