# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The vehicles of finished drives as examples: scans, and which way the vehicle looks in each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.adapting.second_pass import first_pass_of
from wildshape.drives.completing.completion import CATEGORY
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle, read_finished
from wildshape.drives.writing.folder import BOXES, TRACKS
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detections import pose_of
from wildshape.io.guard import read_record
from wildshape.io.tracks import read_track
from wildshape.records import Box, Completion, Points, Track


@dataclass(frozen=True)
class Example:
    """A vehicle that was found.

    Attributes:
        name: of its drive and track.
        scans: in the sensor's frame turned level, metres.
        fronts: `(k, 3)` in the same frames, unit length: where the whole track's boxes look.
        moving: then it looks where it drives.
    """

    name: str
    scans: tuple[Points, ...]
    fronts: Float[np.ndarray, "k 3"]
    moving: bool

    @property
    def track(self) -> Track:
        """Its scans as a track."""
        names = tuple(f"{number:06d}" for number in range(len(self.scans)))
        return Track(self.name, self.scans, names, category=CATEGORY, source="wildshape drive")

    def some(self, count: int) -> "Example":
        """With so many of its scans, spread evenly."""
        rows = np.unique(
            np.linspace(0, len(self.scans) - 1, min(count, len(self.scans))).round().astype(int)
        )
        return Example(
            self.name, tuple(self.scans[row] for row in rows), self.fronts[rows], self.moving
        )

    def share_alike(self, done: Sequence[Completion]) -> float:
        """Share of its scans' completions, one by one, that look as the whole track does."""
        looks = torch.stack([one.pose.rotation[:, 0] for one in done]).numpy()
        return float(((looks * self.fronts).sum(1) > 0).mean())


def examples_of(outs: Sequence[Path], config: AdaptConfig) -> list[Example]:
    """The vehicles of finished drives that were seen well enough, as the first pass found them.

    Raises:
        BadInputError: a drive's folder is damaged.
    """
    found = []
    for out in outs:
        drive = read_finished(out, first_pass_of(out))
        mounting = read_record(out / "stages" / "mounting.json", "the mounting", Mounting)
        for one in drive.vehicles:
            example = _example(drive, one, mounting.levelling(), config)
            found.append(example.some(config.scans))
    return [one for one in found if len(one.scans) >= config.fewest_scans]


def split(examples: Sequence[Example], config: AdaptConfig) -> tuple[list[Example], list[Example]]:
    """Whole tracks to train on, and to measure on, drawn by the seed."""
    order = np.random.default_rng(config.seed).permutation(len(examples))
    held = max(config.fewest_held, round(config.held_out * len(examples)))
    return [examples[i] for i in order[held:]], [examples[i] for i in order[:held]]


def _example(
    drive: FinishedDrive, one: FoundVehicle, T_level_sensor: SE3, config: AdaptConfig
) -> Example:
    found = first_pass_of(drive.out)
    track = read_track(found / TRACKS / one.name)
    boxes = dict(zip((drive.scan_names[frame] for frame in one.frames), one.boxes))
    for name in track.scan_names:
        if name not in boxes:
            raise BadInputError(
                f"{found / BOXES}: no box of track '{one.name}' in scan {name}; run"
                " `wildshape drive` anew with --overwrite."
            )
    full = [
        (boxes[name], scan)
        for name, scan in zip(track.scan_names, track.scans)
        if len(scan) >= config.fewest_points
    ]
    scans = tuple(T_level_sensor.apply_numpy(scan) for _, scan in full)
    fronts = [_front(box, T_level_sensor) for box, _ in full]
    kept = np.array(fronts).reshape(-1, 3)
    return Example(f"{drive.out.resolve().name}-{one.name}", scans, kept, one.moving)


def _front(box: Box, T_level_sensor: SE3) -> Float[np.ndarray, "3"]:
    return (T_level_sensor.rotation @ pose_of(box).rotation[:, 0]).numpy()
