# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever a user points at, as tracks: a packed store, a DATASET, a TRACK, scans, or one scan."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from wildshape.errors import BadInputError
from wildshape.io.points import SUFFIXES, Unit, is_scan_file, read_scan
from wildshape.io.store import is_store, open_store
from wildshape.io.tracks import (
    NoUsableScanError,
    TrackFile,
    folder_name,
    read_info,
    read_track_file,
    scan_files,
    track_of_files,
)
from wildshape.records import Track

_NO_SCANS = ("poses.txt", "shape.ply")  # truth beside scans, not scans
_CURE = (
    "pass a scan file, a TRACK folder (with scans/), a DATASET folder of such tracks, a folder of "
    "scan files, or a packed store"
)


class TrackSource:
    """Tracks that are read when asked for.

    Attributes:
        path: what was opened.
        names: the tracks' names, known without reading them.
    """

    def __init__(
        self, path: Path, names: tuple[str, ...], read: Callable[[int], TrackFile]
    ) -> None:
        """Tracks `names`, of which `read(i)` reads number i."""
        self.path = path
        self.names = names
        self._read = read
        self._skipped: dict[str, str] = {}
        self._dropped: dict[str, int] = {}

    @property
    def skipped(self) -> tuple[tuple[str, str], ...]:
        """`track/scan file` and reason of each scan skipped in the tracks read until now."""
        return tuple(self._skipped.items())

    @property
    def dropped_nonfinite(self) -> tuple[tuple[str, int], ...]:
        """`track/scan file` and number of NaN or infinite points dropped until now."""
        return tuple(self._dropped.items())

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, index: int) -> Track:
        """Read a track.

        Raises:
            IndexError: there is no such track.
            NoUsableScanError: all its scans were refused (they are in `skipped` then).
            BadInputError: its poses, shape or track.json are damaged.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"track {index} of {len(self)}")
        index %= len(self)
        name = self.names[index]
        try:
            found = self._read(index)
        except NoUsableScanError as error:
            self._skipped |= {f"{name}/{scan}": reason for scan, reason in error.skipped}
            raise
        self._skipped |= {f"{name}/{scan}": reason for scan, reason in found.skipped}
        self._dropped |= {f"{name}/{scan}": count for scan, count in found.dropped_nonfinite}
        return found.track

    def __iter__(self) -> Iterator[Track]:
        """The tracks in order; those without a usable scan are passed over (see `skipped`).

        Raises:
            BadInputError: no track has a usable scan, or truth is damaged.
        """
        last, count = None, 0
        for index in range(len(self)):
            try:
                track = self[index]
            except NoUsableScanError as error:
                last = error
                continue
            count += 1
            yield track
        if last is not None and not count:
            raise last


def open_tracks(path: Path | str, unit: Unit = "m") -> TrackSource:
    """The tracks at `path`, lazily.

    Args:
        path: a packed store; a DATASET folder, whose subfolders have scans/; a TRACK folder, which
            has scans/; a folder of scan files (one track); or a scan file (a track of one scan).
        unit: of the files' coordinates; a packed store is in metres always.

    Raises:
        BadInputError: nothing is there, or nothing that can be recognised.
    """
    path = Path(path)
    if not path.exists():
        raise BadInputError(f"{path}: no such file or folder; {_CURE}.")
    if path.is_file():
        return _single_scan(path, unit)
    if is_store(path):
        store = open_store(path)
        return TrackSource(path, store.names, lambda index: TrackFile(store.track(index)))
    if (path / "scans").is_dir():
        scan_files(path / "scans")
        return TrackSource(path, (_name(path),), lambda _: read_track_file(path, unit))
    return _folder(path, unit)


def _single_scan(path: Path, unit: Unit) -> TrackSource:
    if not is_scan_file(path):
        raise BadInputError(f"{path}: no scan file; expected one of {' '.join(SUFFIXES)}.")
    return TrackSource(path, (path.stem,), lambda _: _read_single(path, unit))


def _read_single(path: Path, unit: Unit) -> TrackFile:
    """One scan; where it lies in a TRACK folder, of the unit and sensor that track.json says."""
    beside = path.parent.parent / "track.json" if path.parent.name == "scans" else path / "none"
    info = read_info(beside)
    scan = read_scan(path, info["unit"] if unit == "m" else unit)
    dropped = ((path.name, scan.dropped_nonfinite),) if scan.dropped_nonfinite else ()
    track = Track(path.stem, (scan.points,), (path.stem,), sensor=info["sensor"])
    return TrackFile(track, (), dropped)


def _folder(path: Path, unit: Unit) -> TrackSource:
    """A DATASET, or a plain folder of scan files."""
    entries = sorted(path.iterdir(), key=lambda entry: entry.name)
    shown = [entry for entry in entries if not entry.name.startswith(".")]
    folders = [entry for entry in shown if (entry / "scans").is_dir()]
    if folders:
        names = tuple(folder.name for folder in folders)
        return TrackSource(path, names, lambda index: read_track_file(folders[index], unit))
    files = [f for f in entries if is_scan_file(f) and f.name not in _NO_SCANS]
    if not files:
        found = f"{len(entries)} other entries" if entries else "an empty folder"
        raise BadInputError(f"{path}: found no scans ({found}); {_CURE}.")
    read = partial(track_of_files, files, _name(path), unit)
    return TrackSource(path, (_name(path),), lambda _: read())


def _name(path: Path) -> str:
    return folder_name(path) or "track"
