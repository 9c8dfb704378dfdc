# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The demo's tracks: simulated, or the user's own; those tested are never trained on."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from wildshape.errors import BadInputError
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.progress import Progress, counted
from wildshape.io.scans.points import SENSOR_METRES, Coordinates
from wildshape.io.write_tracks import Written, write_tracks
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

TRAIN, TEST = "data/train.store", "data/test.store"
_TRAIN_SEED, _TEST_SEED = 0, 1
_FEW, _LEAST_TESTED, _LEAST_POINTS = 8, 3, 100


@dataclass(frozen=True)
class DemoOptions:
    """What the demo is asked for.

    Attributes:
        data: the user's own tracks, if any.
        coordinates: of their files.
        tracks: simulated to train on.
        test_tracks: at most, never trained on.
        preset: what is trained.
        seconds: for training; the rest takes two to three minutes more.
        drive_scans: of the simulated drive in the end, ten a second; 0 leaves it out.
        overwrite: replace an earlier demo.
    """

    data: Path | None = None
    coordinates: Coordinates = SENSOR_METRES
    tracks: int = 200
    test_tracks: int = 12
    preset: str = "small"
    seconds: float = 95.0
    drive_scans: int = 100
    overwrite: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.seconds < math.inf:
            raise BadInputError(f"--seconds {self.seconds:g}: expected more than 0.")
        if self.drive_scans < 0:
            raise BadInputError(f"--drive-scans {self.drive_scans}: expected 0 or more.")


@dataclass(frozen=True)
class DemoData:
    """What was prepared, in words."""

    described: str
    tested: str
    note: str = ""


def prepare(out: Path, options: DemoOptions, progress: Progress) -> DemoData:
    """Write the two stores, `TRAIN` and `TEST`.

    Raises:
        BadInputError: the user's data cannot be used.
    """
    if options.data is not None:
        return _own(out, options, open_tracks(options.data, options.coordinates), progress)
    trained = _simulate(out / TRAIN, options.tracks, _TRAIN_SEED, progress)
    tested = _simulate(out / TEST, options.test_tracks, _TEST_SEED, progress)
    return DemoData(_words("simulated", trained), _words("other simulated", tested))


def _simulate(path: Path, tracks: int, seed: int, progress: Progress) -> Written:
    config = SimulationConfig(tracks=tracks)
    return _store(simulate_tracks(config, seed), path, ("simulating", tracks), progress)


def _own(out: Path, options: DemoOptions, source: TrackSource, progress: Progress) -> DemoData:
    """A fifth of the user's tracks, spread evenly, is tested; too few of them are all tested."""
    count = len(source)
    few = count < _FEW
    share = count if few else max(_LEAST_TESTED, count // 5)
    tested_count = min(share, options.test_tracks)
    test = {(2 * i + 1) * count // (2 * tested_count) for i in range(tested_count)}
    tested = _store(_only(source, test), out / TEST, ("reading", len(test)), progress)
    rest = set(range(count)) - test
    if few or not any(_trainable(track) for track in _only(source, rest)):
        note = (
            f"{source.path} has too few tracks with several scans of {_LEAST_POINTS} points or"
            " more to train on, so the model was trained on simulated cars"
        )
        progress.say(note)
        trained = _simulate(out / TRAIN, options.tracks, _TRAIN_SEED, progress)
        kind = "simulated"
    else:
        note, kind = "", "of your"
        trained = _store(_only(source, rest), out / TRAIN, ("reading", len(rest)), progress)
    progress.skipped(source.skipped)
    return DemoData(_words(kind, trained), _words("of your", tested), note)


def _only(source: TrackSource, numbers: set[int]) -> Iterator[Track]:
    wanted = {source.names[i] for i in numbers}
    return (track for _, track in source.tracks(lambda name: name not in wanted))


def _trainable(track: Track) -> bool:
    return sum(len(scan) >= _LEAST_POINTS for scan in track.scans) > 1


def _store(
    tracks: Iterable[Track], path: Path, bar: tuple[str, int], progress: Progress
) -> Written:
    return write_tracks(
        tracks,
        path,
        "packed",
        command="demo",
        settings={"store": path.name},
        overwrite=True,
        progress=progress,
        bar=bar,
    )


def _words(kind: str, written: Written) -> str:
    return f"{counted(written.scans, 'scan')} of {counted(written.tracks, f'{kind} track')}"
