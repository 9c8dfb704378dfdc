# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""SemanticKITTI as it lies on disk: labelled points of vehicles become tracks.

The labels are read twice: first alone, to know in which frames each object is seen; then with the
scans. So an object is handed out, and forgotten, right after the last frame that shows it, although
the sensor may come by again after minutes.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from wildshape.datasets.kitti.raw import HDL64E
from wildshape.datasets.semantic_kitti.labels import (
    LABELS_CURE,
    VEHICLES,
    Visit,
    categories_of,
    count_points,
    visits_of,
)
from wildshape.datasets.semantic_kitti.sequence import Sequence, find_sequences, open_sequence
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.stationary import stand
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan, sight_lines
from wildshape.records import Track

Split = Literal["train", "test", "all"]
SPLITS: dict[Split, tuple[str, ...]] = {
    "train": ("00", "01", "02", "03", "04", "05", "06", "07", "09", "10"),
    "test": ("08",),
    "all": (),
}
PAPER = Selection(motion="parked", min_mean_points=512)
"""The selection of Gu et al., section 5.1."""

LONGEST_M = {"car": 8.0, "bicycle": 4.0, "motorcycle": 4.0, "on-rails": 60.0}
"""How long an object of a category can be: no two of its scans have their middles further apart."""


@dataclass
class SemanticKitti:
    """Vehicles of SemanticKITTI; a part is a sequence.

    Parked ones come with poses from odometry, in a frame of their own (see `stand`); those that
    moved come without, as odometry does not know where they went. A sequence that has neither
    calib.txt nor poses.txt gives scans alone.

    Attributes:
        root: the folder above `sequences`, `sequences`, or one sequence.
        selection: categories are `CLASSES`, by default `VEHICLES`; what moved is what its class
            says moved. `PAPER` is the paper's.
        split: `test` is sequence 08, `train` the other ten that have labels, all of which must be
            there; `all`: whatever is there.
        labels: folder of a sequence with the `.label` files.
        gap: an object not seen well for more frames than this comes back as another track; None:
            it stays one object over the whole sequence, as it is labelled.
        longest_m: as `LONGEST_M`, of the categories that it does not name, metres.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    split: Split = "all"
    labels: str = "labels"
    gap: int | None = None
    longest_m: float = 20.0
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The sequences of the split.

        Raises:
            BadInputError: there is none, one of the split is missing, or none has labels.
        """
        found = find_sequences(Path(self.root))
        labelled = [name for name, folder in found.items() if (folder / self.labels).is_dir()]
        missing = [name for name in SPLITS[self.split] if name not in labelled]
        if not labelled:
            raise BadInputError(
                f"{self.root}: none of the sequences {' '.join(found)} has a folder {self.labels}; "
                f"{LABELS_CURE}, or name your own with --labels."
            )
        if missing:
            raise BadInputError(
                f"{self.root}: split {self.split} lacks the sequences {' '.join(missing)} (with a "
                f"folder {self.labels} there are {' '.join(labelled)}): add them, or take the "
                "split 'all' of what is there."
            )
        return [name for name in found if name in (SPLITS[self.split] or found)]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a sequence, each as soon as its object is seen for the last time.

        Raises:
            BadInputError: a file of the sequence is missing or corrupt, or a scan and its labels
                differ in length.
        """
        folder = find_sequences(Path(self.root))[part]
        if not (folder / self.labels).is_dir():
            self.rejected[f"sequence without a folder {self.labels}"] += 1
            return
        kinds = categories_of(self.selection.categories or VEHICLES, self.selection.motion)
        sequence = open_sequence(folder, part, self.labels, kinds)
        schedule = self._schedule(count_points(sequence.files, kinds))
        # What moved is known by class; places would tell nothing more.
        selection = replace(self.selection, motion="any")
        gathering = Gathering(selection, HDL64E, self.rejected, rays=self.rays)
        for frame, visits in sorted(schedule.items()):
            self._cut(sequence, frame, visits, gathering)
            yield from self._finished(gathering, frame)
        yield from gathering.finished()  # nothing is left; says so if no file could be read

    def _schedule(self, counts: dict[int, dict[int, int]]) -> dict[int, list[Visit]]:
        """Which objects are to be cut out of which frame."""
        least = max(self.selection.min_points, 1)
        schedule: dict[int, list[Visit]] = defaultdict(list)
        for label, points in sorted(counts.items()):
            frames = [frame for frame, count in points.items() if count >= least]
            self._count(f"scan: fewer than {least} points on the object", len(points) - len(frames))
            self._count("object: fewer than 1 scans left", int(not frames))
            for visit in visits_of(label, frames, self.gap):
                for frame in visit.frames:
                    schedule[frame].append(visit)
        return schedule

    def _cut(self, sequence: Sequence, frame: int, visits: list[Visit], to: Gathering) -> None:
        # The object's last frame is known: that it may be handed out after, and not before.
        wanted = [v for v in visits if to.wants(frame=v.frames[-1], **sequence.words(v))]
        read = partial(sequence.labelled_points, frame, whole=self.rays)
        found = to.read(read, len(wanted))
        if found is None:
            return
        labels, points = found
        full = FullScan(points, sequence.ray_starts(frame, points) if self.rays else None)
        for visit in wanted:
            poses = sequence.T_velo_world
            pose = None if poses is None or sequence.kind(visit).moved else poses[frame]
            name = sequence.words(visit)["name"]
            rows = np.flatnonzero(labels == visit.label)
            rays = partial(sight_lines, full, rows)
            to.add(name, sequence.scan_file(frame).stem, points[rows], pose, rays=rays)

    def _finished(self, gathering: Gathering, frame: int) -> Iterator[Track]:
        """Tracks that end at a frame; those of stationary objects in the object's own frame."""
        for track in gathering.finished(before=frame + 1):
            if track.T_sensor_object is None:
                yield track
                continue
            stationary_frame = stand(track.scans, track.T_sensor_object)
            if stationary_frame.spread > LONGEST_M.get(track.category, self.longest_m):
                self._count("object: its label lies in several places", 1)
                continue
            size = " x ".join(f"{length:.2f}" for length in stationary_frame.size)
            source = f"{track.source}, poses from odometry, its points fill {size} m"
            yield replace(track, source=source, T_sensor_object=stationary_frame.T_sensor_object)

    def _count(self, reason: str, count: int) -> None:
        if count:
            self.rejected[reason] += count
