# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `complete` and `register` left of a track, read back: objects.json and what is beside."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detections import read_box
from wildshape.io.guard import read_json, reading
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.poses import read_poses
from wildshape.io.scans.points import (
    METRES,
    SENSOR_METRES,
    Coordinates,
    checksum_of,
    read_points,
)
from wildshape.io.scans.writers import CLOUD_FORMATS
from wildshape.records import Box, Points, SensorKind, Track

MARKER, OBJECTS, METRICS, SCORES = "wildshape.json", "objects.json", "metrics.json", "scores.json"
_SAID = "what complete or register writes"
_OTHERS = "not the points that were completed: --inputs names others"
PROBABILITIES = {"p_pose": "heading right", "p_box": "box right", "p_kind": "kind right"}
MEANING = (
    "The chances that the heading is within 10° of the truth, that the box shares 0.7 of the joint "
    "area with the true one, from above, and that it is an object of the kind trained on; the "
    "confidence is their product."
)


@dataclass(frozen=True)
class TrackResult:
    """One track's folder.

    Attributes:
        record: the content of its objects.json.
        track: the scans it is about; None where they have moved, changed or were lost.
    """

    folder: Path
    record: dict[str, Any]
    track: Track | None

    @property
    def entries(self) -> Sequence[dict[str, Any]]:
        """What objects.json says of each scan, in their order in time."""
        return self.record.get("scans") or ()

    @property
    def scans(self) -> tuple[str, ...]:
        """Names of the scans that have a result, in their order in time."""
        return tuple(str(entry["scan"]) for entry in self.entries)

    @property
    def sensor(self) -> SensorKind:
        """What took the scans: which way is up in the completed shapes."""
        return "camera" if self.record.get("sensor") == "camera" else "lidar"

    def entry(self, scan: str) -> dict[str, Any]:
        """What objects.json says of a scan."""
        return self._entries.get(scan, {})

    @cached_property
    def _entries(self) -> dict[str, dict[str, Any]]:
        return {str(entry["scan"]): entry for entry in reversed(self.entries)}

    def completed(self, scan: str) -> Points | None:
        """The completed shape, in that scan's sensor frame, metres."""
        for kind in CLOUD_FORMATS:
            path = self.folder / "completed" / f"{scan}.{kind}"
            if path.exists():
                return read_points(path)
        return None

    def completed_scans(self) -> list[str]:
        """Names of the scans that have a completed shape."""
        folder = self.folder / "completed"
        return sorted(path.stem for kind in CLOUD_FORMATS for path in folder.glob(f"*.{kind}"))

    def poses(self) -> SE3 | None:
        """`T_sensor_canonical`, one a scan of objects.json (or of the track); None without."""
        path = self.folder / "poses.txt"
        return read_poses(path) if path.exists() else None


@dataclass
class Inputs:
    """The scans that results are about, each place opened once.

    Attributes:
        place: where the scans are now; None goes by what objects.json says, as long as the scans
            there are those that were completed.
    """

    place: Path | None = None
    opened: dict[tuple[Path, Coordinates], TrackSource] = field(default_factory=dict)

    def track(self, folder: Path, record: dict[str, Any]) -> Track | None:
        """The completed scans of the track that `folder` is about.

        None if they have moved, changed or lost it. Changed ones that were named are told in
        `source`.
        """
        named = self.place or (Path(record["input"]) if record.get("input") else None)
        if named is None:
            return None
        try:
            source = self._open(named, coordinates_of(_settings(folder.parent / MARKER)))
            track = source[source.numbers[str(record.get("track") or folder.name)]]
        except (BadInputError, KeyError, ValueError):
            return None
        return self._completed(track, record.get("scans") or ())

    def check(self, folders: Sequence[Path]) -> None:
        """Open the place that was named for the results of folders.

        Raises:
            BadInputError: there are no scans of these results, or how they were read is damaged.
        """
        if self.place is None:
            return
        if not folders:
            raise BadInputError(f"--inputs {self.place}: no results of scans here; leave it out.")
        marker = folders[0].parent / MARKER
        with reading(marker, "how the scans of results were read"):
            coordinates = coordinates_of(_settings(marker))
        names = {folder.name for folder in folders}
        names.add(str(read_json(folders[0] / OBJECTS, _SAID, dict).get("track")))
        if names.isdisjoint(self._open(self.place, coordinates).names):
            raise BadInputError(
                f"--inputs {self.place}: holds no track '{folders[0].name}'; name the scans under"
                " the names that they had."
            )

    def _completed(self, track: Track, entries: Sequence[dict[str, Any]]) -> Track | None:
        """The scans of a track that these entries of objects.json are of."""
        sums = {str(entry["scan"]): entry.get("points_crc32") for entry in entries}
        kept = [i for i, name in enumerate(track.scan_names) if name in sums or not sums]
        if not kept:
            return None
        track = track.part(kept)
        found = zip(track.scan_names, map(checksum_of, track.scans))
        if all(sums.get(name) in (None, points_crc32) for name, points_crc32 in found):
            return track
        return None if self.place is None else replace(track, source=_OTHERS)

    def _open(self, path: Path, coordinates: Coordinates) -> TrackSource:
        if (path, coordinates) not in self.opened:
            self.opened[path, coordinates] = open_tracks(path, coordinates)
        return self.opened[path, coordinates]


def find(folder: Path, name: str) -> list[Path]:
    """Files of that name in a folder and two levels below; not what is set aside there."""
    found = {path for depth in ("", "[!.]*/", "[!.]*/*/") for path in folder.glob(f"{depth}{name}")}
    return sorted(found)


def read_result(folder: Path, inputs: Inputs | None = None) -> TrackResult:
    """A track's result, with its scans where they can be read; without `inputs` none are.

    Raises:
        BadInputError: objects.json is damaged.
    """
    with reading(folder / OBJECTS, _SAID):
        record = read_json(folder / OBJECTS, _SAID, dict)
        track = None if inputs is None else inputs.track(folder, record)
        found = TrackResult(folder, record, track)
        for scan in found.scans:
            box_of(found.entry(scan))
            doubt_of(found.entry(scan))
        chances_of(found.entries)
    return found


def chances_in(folder: Path) -> dict[str, float]:
    """`chances_of` all scans of a track's folder.

    Raises:
        BadInputError: objects.json is damaged.
    """
    with reading(folder / OBJECTS, _SAID):
        return chances_of(read_json(folder / OBJECTS, _SAID, dict).get("scans") or ())


def chances_of_scores(scores: Path, method: str) -> dict[str, dict[str, float]]:
    """`chances_of` each track by one method's row in scores.json.

    Raises:
        BadInputError: the file is damaged.
    """
    scans: dict[str, list[dict[str, Any]]] = {}
    with reading(scores, "what evaluate writes"):
        for scan in _rows_of(scores, method, "completions"):
            scans.setdefault(str(scan["track"]), []).append(scan)
        return {track: chances_of(entries) for track, entries in scans.items()}


def _rows_of(scores: Path, method: str, what: str) -> Iterator[dict[str, Any]]:
    """Records of one method in scores.json: `completions` or `registrations`."""
    runs = json.loads(scores.read_text("utf-8"))["runs"]
    for row in (row for run in runs for row in run["methods"] if row["name"] == method):
        yield from row[what]


def errors_of_scores(scores: Path, method: str) -> dict[str, dict[str, list[float]]]:
    """Errors of one method's row in scores.json, by track: `cd`, `rotation_deg`, `translation_m`.

    Raises:
        BadInputError: the file is damaged.
    """
    found: dict[str, dict[str, list[float]]] = {"cd": {}, "rotation_deg": {}, "translation_m": {}}
    with reading(scores, "what evaluate writes"):
        for scan in _rows_of(scores, method, "completions"):
            cd = float(scan["error"]["precision"]) + float(scan["error"]["coverage"])
            found["cd"].setdefault(str(scan["track"]), []).append(cd)
        for scan in _rows_of(scores, method, "registrations"):
            for name in ("rotation_deg", "translation_m"):
                found[name].setdefault(str(scan["track"]), []).append(float(scan[name]))
    return found


def doubt_of(entry: Mapping[str, Any]) -> str:
    """Why a scan's result is not to be trusted: its warning, or its reasons in plain words."""
    reasons = ", ".join(str(reason).replace("_", " ") for reason in entry.get("reasons") or ())
    return str(entry.get("warning") or reasons)


def chances_of(entries: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Mean probabilities of scans, by the words for them (`MEANING`); without those not stated."""
    found = {}
    for key, words in PROBABILITIES.items():
        stated = [float(entry[key]) for entry in entries if entry.get(key) is not None]
        if stated:
            found[words] = sum(stated) / len(stated)
    return found


def box_of(entry: dict[str, Any]) -> Box | None:
    """The box of an entry of objects.json, in the scan's sensor frame."""
    if not entry.get("box"):
        return None
    return read_box(entry["box"])


def coordinates_of(settings: dict[str, Any]) -> Coordinates:
    """How the scans were read, by the settings in a `wildshape.json` or `metrics.json`."""
    unit, origin = settings.get("unit", "m"), settings.get("origin") or SENSOR_METRES.origin
    x, y, z = (float(value) for value in origin)
    return Coordinates(unit if unit in METRES else "m", (x, y, z))


def _settings(marker: Path) -> dict[str, Any]:
    said = "what a command says of itself"
    return read_json(marker, said, dict).get("settings") or {} if marker.exists() else {}
