# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The tracks of an input, one at a time; what cannot be used is counted with its reason."""

from collections.abc import Callable, Iterator
from pathlib import Path

from wildshape.cli.terminal import counted
from wildshape.errors import BadInputError
from wildshape.io.inputs import open_tracks
from wildshape.io.scans.points import SENSOR_METRES, Coordinates, check_scan
from wildshape.records import Track


class Reading:
    """Tracks of a scan, TRACK, DATASET or packed store.

    Attributes:
        source: where they come from; `source.names` are known without reading.
        refused: tracks and scans that could not be used, with the reason.
    """

    def __init__(self, path: Path, coordinates: Coordinates = SENSOR_METRES) -> None:
        """Open an input.

        Raises:
            BadInputError: it is none, or two of its tracks could not be told apart as folders.
        """
        self.source = open_tracks(path, coordinates)
        self.refused: dict[str, str] = {}
        self._refused_in: dict[str, dict[str, str]] = {}

    @property
    def skipped(self) -> list[tuple[str, str]]:
        """`track` or `track/scan`, and the reason."""
        return [*self.source.skipped, *self.refused.items()]

    def skipped_in(self, track: str) -> list[tuple[str, str]]:
        """Scan and reason, of one track."""
        return [*self.source.skipped_in(track), *self._refused_in.get(track, {}).items()]

    @property
    def dropped(self) -> str:
        """A sentence on points that were not finite, or nothing."""
        counts = [count for _, count in self.source.dropped_nonfinite]
        if not counts:
            return ""
        points, scans = counted(sum(counts), "point"), counted(len(counts), "scan")
        return f"dropped {points} with NaN or infinity in {scans}"

    def tracks(self, done: Callable[[str], bool] = lambda _: False) -> Iterator[tuple[int, Track]]:
        """The usable tracks with their numbers, without those that are done already.

        Raises:
            BadInputError: not a single track can be used.
        """
        last, count = None, 0
        for index, name in enumerate(self.source.names):
            if done(name):
                count += 1
                continue
            try:
                track = self._usable(self.source[index])
            except BadInputError as error:
                last = error
                self.refused[name] = str(error)
                continue
            count += 1
            yield index, track
        if last is not None and not count:
            raise last

    def track(self, index: int) -> Track:
        """A usable track by its number.

        Raises:
            BadInputError: it cannot be used.
        """
        return self._usable(self.source[index])

    def single(self, why: str) -> Track:
        """The only track.

        Raises:
            BadInputError: there are several, or it cannot be used.
        """
        names = self.source.names
        if len(names) != 1:
            raise BadInputError(
                f"{self.source.path}: holds {len(names)} tracks, but {why} takes one; name the"
                f" folder of one, such as {names[0]} (`wildshape convert packed STORE OUT --layout"
                " folders` makes folders of a packed store)."
            )
        return next(track for _, track in self.tracks())

    def _usable(self, track: Track) -> Track:
        """The track without scans that no model can take (those of a packed store, too)."""
        kept, reason = [], "it has no scan."
        for i, scan in enumerate(track.scans):
            where = f"{track.name}/{track.scan_names[i]}"
            try:
                check_scan(scan, where)
            except BadInputError as error:
                self.refused[where] = reason = str(error)
                self._refused_in.setdefault(track.name, {})[track.scan_names[i]] = reason
                continue
            kept.append(i)
        if not kept:
            raise BadInputError(f"{track.name}: no scan can be used; {reason}")
        return track if len(kept) == len(track.scans) else track.part(kept)
