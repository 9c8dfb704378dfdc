# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The demo's tracks: simulated, or the user's own; those tested are never trained on."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from wildshape.cli.input.tracks import Reading
from wildshape.cli.packing import Written, write_tracks
from wildshape.cli.terminal import counted, progress, say, say_skipped
from wildshape.io.scans.points import Coordinates
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

TRAIN, TEST = "data/train.store", "data/test.store"
_TRAIN_SEED, _TEST_SEED = 0, 1
_FEW, _LEAST_TESTED, _LEAST_POINTS = 8, 3, 100


@dataclass(frozen=True)
class Wanted:
    """What the demo is asked for.

    Attributes:
        out: its folder.
        data: the user's own tracks, if any.
        coordinates: of their files.
        tracks: simulated to train on.
        test_tracks: at most, never trained on.
    """

    out: Path
    data: Path | None
    coordinates: Coordinates
    tracks: int
    test_tracks: int


@dataclass(frozen=True)
class DemoData:
    """What was prepared, in words."""

    described: str
    tested: str
    note: str = ""


def prepare(wanted: Wanted) -> DemoData:
    """Write the two stores, `TRAIN` and `TEST`.

    Raises:
        BadInputError: the user's data cannot be used.
    """
    if wanted.data is not None:
        return _own(wanted, wanted.data)
    trained = _simulate(wanted.out / TRAIN, wanted.tracks, _TRAIN_SEED)
    tested = _simulate(wanted.out / TEST, wanted.test_tracks, _TEST_SEED)
    return DemoData(_words("simulated", trained), _words("other simulated", tested))


def _simulate(path: Path, tracks: int, seed: int) -> Written:
    config = SimulationConfig(tracks=tracks)
    return _store(simulate_tracks(config, seed), path, tracks, "simulating")


def _own(wanted: Wanted, folder: Path) -> DemoData:
    """A fifth of the user's tracks, spread evenly, is tested; too few of them are all tested."""
    reading = Reading(folder, wanted.coordinates)
    count = len(reading.source)
    few = count < _FEW
    share = count if few else max(_LEAST_TESTED, count // 5)
    tested_count = min(share, wanted.test_tracks)
    test = {(2 * i + 1) * count // (2 * tested_count) for i in range(tested_count)}
    tested = _store(_only(reading, test), wanted.out / TEST, len(test), "reading")
    rest = set(range(count)) - test
    if few or not any(_trainable(track) for track in _only(reading, rest)):
        note = (
            f"{folder} has too few tracks with several scans of {_LEAST_POINTS} points or more to"
            " train on, so the model was trained on simulated cars"
        )
        say(note)
        trained, kind = _simulate(wanted.out / TRAIN, wanted.tracks, _TRAIN_SEED), "simulated"
    else:
        note, kind = "", "of your"
        trained = _store(_only(reading, rest), wanted.out / TRAIN, len(rest), "reading")
    say_skipped(reading.skipped)
    return DemoData(_words(kind, trained), _words("of your", tested), note)


def _only(reading: Reading, numbers: set[int]) -> Iterator[Track]:
    names = reading.source.names
    wanted = {names[i] for i in numbers}
    return (track for _, track in reading.tracks(lambda name: name not in wanted))


def _trainable(track: Track) -> bool:
    return sum(len(scan) >= _LEAST_POINTS for scan in track.scans) > 1


def _store(tracks: Iterable[Track], path: Path, total: int, label: str) -> Written:
    with progress(label, total) as bar:
        return write_tracks(
            tracks,
            path,
            "packed",
            command="demo",
            settings={"store": path.name},
            overwrite=True,
            at=bar.at,
        )


def _words(kind: str, written: Written) -> str:
    return f"{counted(written.scans, 'scan')} of {counted(written.tracks, f'{kind} track')}"
