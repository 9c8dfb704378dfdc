# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever a user points at, as tracks: a packed store, a DATASET, a TRACK, scans, or one scan."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from wildshape.arguments import as_path
from wildshape.errors import BadInputError
from wildshape.io.progress import counted
from wildshape.io.rays import check_rays, read_rays
from wildshape.io.scans.points import (
    SENSOR_METRES,
    SUFFIXES,
    Coordinates,
    check_scan,
    checked,
    is_scan_file,
    read_scan,
    without_repeats,
)
from wildshape.io.store.store import is_store, open_store
from wildshape.io.tracks import (
    NoUsableScanError,
    TrackFile,
    folder_name,
    rays_beside,
    read_info,
    read_track_file,
    scan_files,
    track_of_files,
)
from wildshape.records import Sensor, SensorKind, Track, as_text

_NO_SCANS = ("poses.txt", "times.txt", "timestamps.txt", "shape.ply")  # beside scans, not scans
_TEXT = (".txt", ".csv")  # may be anything
_CURE = (
    "pass a scan file, a TRACK folder (with scans/), a DATASET folder of such tracks, a folder of "
    "scan files, or a packed store"
)


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


class TrackSource:
    """Tracks that are read when asked for; what cannot be used is kept with its reason.

    Attributes:
        path: what was opened.
        names: the tracks' names, known without reading them.
        refused: tracks passed over as a whole, with the reason.
    """

    def __init__(
        self, path: Path, names: tuple[str, ...], read: Callable[[int], TrackFile]
    ) -> None:
        """Tracks `names`, of which `read(i)` reads number i."""
        self.path = path
        self.names = names
        self.refused: dict[str, str] = {}
        self._read = read
        self._skipped: dict[str, tuple[tuple[str, str], ...]] = {}  # by track
        self._dropped: dict[str, int] = {}
        self._odd: dict[str, dict[str, str]] = {}  # by kind and track
        self._kinds: set[SensorKind] = set()

    @property
    def sensor_kinds(self) -> tuple[SensorKind, ...]:
        """The kinds of sensor that took the tracks read until now, in the order of the alphabet."""
        return tuple(sorted(self._kinds))

    @property
    def skipped(self) -> tuple[tuple[str, str], ...]:
        """`track/scan` or `track`, and the reason, of what could not be used until now."""
        scans = [(f"{name}/{s}", why) for name in self._skipped for s, why in self.skipped_in(name)]
        return (*scans, *self.refused.items())

    def skipped_in(self, name: str) -> tuple[tuple[str, str], ...]:
        """Scan file and reason of each scan skipped in a track that has been read."""
        return self._skipped.get(name, ())

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The number of each track, by its name; the first, where two have one name."""
        return {name: number for number, name in reversed(list(enumerate(self.names)))}

    @property
    def doubts(self) -> tuple[str, ...]:
        """A sentence each on points that were dropped, and on names that are odd, by kind."""
        told = []
        if self._dropped:
            points = counted(sum(self._dropped.values()), "point")
            scans = counted(len(self._dropped), "scan")
            told.append(f"dropped {points} of NaN, infinity or zeros alone in {scans}")
        for tracks in self._odd.values():
            name, odd = next(iter(tracks.items()))
            more = len(tracks) - 1
            others = f" ({counted(more, 'more track')} likewise)" if more else ""
            told.append(f"{name}: {odd}{others}")
        return tuple(told)

    @property
    def dropped_nonfinite(self) -> tuple[tuple[str, int], ...]:
        """`track/scan file` and number of points that `read_scan` dropped until now."""
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
            self._skipped[name] = error.skipped
            raise
        self._skipped[name] = found.skipped
        self._kinds.add(found.track.sensor.kind)
        self._dropped |= {f"{name}/{scan}": count for scan, count in found.dropped_nonfinite}
        for kind, odd in found.doubts.items():
            self._odd.setdefault(kind, {})[name] = odd
        return found.track

    def __iter__(self) -> Iterator[Track]:
        """The usable tracks in order; see `tracks`."""
        return (track for _, track in self.tracks())

    def tracks(self, done: Callable[[str], bool] = lambda _: False) -> Iterator[tuple[int, Track]]:
        """The usable tracks with their numbers, without those that are `done`, by their names.

        Raises:
            BadInputError: not a single track can be used.
        """
        last, count = None, 0
        for index, name in enumerate(self.names):
            if done(name):
                count += 1
                continue
            try:
                track = self[index]
            except BadInputError as error:
                last = error
                self.refused[name] = str(error)
                continue
            count += 1
            yield index, track
        if last is not None and not count:
            raise last

    def parts(self, most: int | None, done: Callable[[str], bool]) -> Iterator[Part]:
        """The usable tracks in parts of at most so many scans, None: whole; `done` as of `tracks`.

        Raises:
            BadInputError: not a single track can be used.
        """
        for index, track in self.tracks(done):
            count = len(track.scans)
            size = most or count
            for first in range(0, count, size):
                rows = list(range(first, min(first + size, count)))
                yield Part(index, replace(track.part(rows), shape=None), first, count)

    def single(self, why: str) -> Track:
        """The only track; `why` is what takes one, for the error.

        Raises:
            BadInputError: there are several, or it cannot be used.
        """
        if len(self) != 1:
            raise BadInputError(
                f"{self.path}: holds {len(self)} tracks, but {why} takes one; name the"
                f" folder of one, such as {self.names[0]} (`wildshape convert packed STORE OUT"
                " --layout folders` makes folders of a packed store)."
            )
        return self[0]


def open_tracks(path: Path | str, coordinates: Coordinates = SENSOR_METRES) -> TrackSource:
    """The tracks at `path`, lazily.

    Args:
        path: a packed store; a DATASET folder of TRACK folders, which have scans/; what `drive`
            found in several recordings; a TRACK; or a scan file or a folder of some, one track.
        coordinates: of the files; a packed store is in metres and its sensors' frames always.

    Raises:
        BadInputError: nothing is there, or nothing that can be recognised; or a packed store that
            is to be read otherwise.
    """
    path, coordinates = as_path(path, "path"), checked(coordinates)
    if not (path.is_file() or path.is_dir()):
        there = "a pipe; write it to a file and" if path.exists() else "no such file or folder;"
        raise BadInputError(f"{path}: {there} {_CURE}.")
    if path.is_file():
        return _single_scan(path, coordinates)
    if is_store(path):
        refuse_other_coordinates(path, coordinates)
        store = open_store(path)
        return TrackSource(path, store.names, lambda index: _checked(store.track(index)))
    if (path / "scans").is_dir():
        scan_files(path / "scans")
        return TrackSource(path, (_name(path),), lambda _: read_track_file(path, coordinates))
    return _folder(path, coordinates)


def refuse_other_coordinates(store: Path, coordinates: Coordinates) -> None:
    """Refuse to read a packed store in another unit or frame.

    Raises:
        BadInputError: that is asked for.
    """
    if coordinates != SENSOR_METRES:
        raise BadInputError(
            f"{store}: a packed store is in metres and its sensors' frames already; leave --unit"
            " and --origin away, and give them to `convert`."
        )


def with_rays(source: TrackSource, path: Path, coordinates: Coordinates) -> TrackSource:
    """The one scan of a source with the rays in a file.

    Raises:
        BadInputError: there are several tracks or scans, or the file holds no rays.
    """
    track = source.single("--rays")
    rays = read_rays(path, _in_unit_of(source, coordinates))
    if len(track.scans) != 1:
        raise BadInputError(
            f"{path}: rays of one scan, but {source.path} holds {len(track.scans)}; keep those of a"
            " track in its folder rays/, named as the scans."
        )
    check_rays(rays, track.scans[0], str(path))
    dropped = tuple(
        (name.removeprefix(f"{track.name}/"), count) for name, count in source.dropped_nonfinite
    )
    seen = TrackFile(replace(track, rays=(rays,)), source.skipped_in(track.name), dropped)
    return TrackSource(source.path, source.names, lambda _: seen)


def _in_unit_of(source: TrackSource, coordinates: Coordinates) -> Coordinates:
    """As the one scan of a source was read: a track.json beside it may name its unit."""
    path = source.path
    places = path.parent.parent, path, *(path / name for name in source.names)
    for folder in places[:1] if path.is_file() and path.parent.name == "scans" else places[1:]:
        if (folder / "scans").is_dir():
            return coordinates.in_unit(read_info(folder / "track.json")["unit"])
    return coordinates


def _checked(track: Track) -> TrackFile:
    """A track of a packed store: without useless scans, each place once; copies, no views.

    Raises:
        NoUsableScanError: all of them.
    """
    kept, skipped = [], []
    for number, (name, scan) in enumerate(zip(track.scan_names, track.scans)):
        try:
            check_scan(scan, f"{track.name}/{name}")
        except BadInputError as error:
            skipped.append((name, str(error)))
            continue
        kept.append(number)
    if not kept:
        raise NoUsableScanError(Path(track.name), tuple(skipped))
    usable = track.part(kept) if skipped else track
    scans = tuple(without_repeats(scan).copy() for scan in usable.scans)
    shape = None if usable.shape is None else usable.shape.copy()
    return TrackFile(replace(usable, scans=scans, shape=shape), tuple(skipped))


def _single_scan(path: Path, coordinates: Coordinates) -> TrackSource:
    if not is_scan_file(path):
        raise BadInputError(f"{path}: no scan file; expected one of {' '.join(SUFFIXES)}.")
    return TrackSource(path, (as_text(path.stem),), lambda _: _read_single(path, coordinates))


def _read_single(path: Path, coordinates: Coordinates) -> TrackFile:
    """One scan; where it lies in a TRACK folder, with its rays, its unit and its sensor."""
    sensor, is_in_track = Sensor(), path.parent.name == "scans"
    if is_in_track:
        info = read_info(path.parent.parent / "track.json")
        sensor, coordinates = info["sensor"], coordinates.in_unit(info["unit"])
    scan = read_scan(path, coordinates)
    rays = (rays_beside(path, scan.points, coordinates),) if is_in_track else ()
    dropped = ((path.name, scan.dropped_nonfinite),) if scan.dropped_nonfinite else ()
    track = Track(path.stem, (scan.points,), (path.stem,), sensor=sensor, rays=rays)
    return TrackFile(track, (), dropped)


def _folder(path: Path, coordinates: Coordinates) -> TrackSource:
    """A DATASET, what `drive` found in several recordings, or a plain folder of scan files."""
    entries = sorted(path.iterdir(), key=lambda entry: entry.name)
    shown = [entry for entry in entries if not entry.name.startswith(".")]
    folders = [entry for entry in shown if (entry / "scans").is_dir()]
    if (path / "boxes.csv").is_file() and (path / "tracks").is_dir():
        raise BadInputError(f"{path}: holds what `drive` found; name {path / 'tracks'}.")
    folders = folders or sorted(one.parent for one in path.glob("[!.]*/tracks/[!.]*/scans"))
    if folders:
        for other in (entry for entry in shown if entry.is_dir() and entry not in folders):
            if any(is_scan_file(f) and f.suffix.lower() not in _TEXT for f in other.iterdir()):
                raise BadInputError(f"{other}: has points, but no scans/; move its scans there.")
        names = tuple(as_text("_".join(one.relative_to(path).parts[::2])) for one in folders)
        return TrackSource(
            path, names, lambda row: read_track_file(folders[row], coordinates, names[row])
        )
    files = [f for f in entries if is_scan_file(f) and f.name not in _NO_SCANS]
    if not files:
        found = f"{len(entries)} other entries" if entries else "an empty folder"
        raise BadInputError(f"{path}: found no scans ({found}); {_CURE}.")
    read = partial(track_of_files, files, _name(path), coordinates)
    return TrackSource(path, (_name(path),), lambda _: read())


def _name(path: Path) -> str:
    return as_text(folder_name(path)) or "track"
