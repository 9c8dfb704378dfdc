# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Found drives against their labels: ours, and other boxes around the same clusters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from wildshape.arguments import expect
from wildshape.errors import BadInputError
from wildshape.evaluation.drives.average_precision import (
    HIT,
    MISS,
    Ranked,
    average_precision,
    match,
    pooled,
    recall_when_sure,
)
from wildshape.evaluation.drives.found import (
    Clusters,
    Found,
    FoundDrive,
    kept_clusters,
    points_inside,
)
from wildshape.evaluation.drives.labels import LabelledDrive, LabelledFrame, View
from wildshape.evaluation.drives.motion import Correction, like_found, sampled_frames
from wildshape.evaluation.drives.overlap import Overlaps, UprightBox, overlaps
from wildshape.evaluation.drives.rectangles import l_shape, smallest_rectangle
from wildshape.evaluation.drives.same_scans import check_same_scans
from wildshape.evaluation.drives.tracking import (
    Hota,
    Pairs,
    Purity,
    belonging,
    hota,
    identity_switches,
    purity,
)
from wildshape.evaluation.drives.trajectory import TrajectoryError, trajectory_error
from wildshape.records import Points

OURS = "wildshape"
LEAST_IOU = (0.5, 0.7)
KINDS = ("bev", "3d")
BASELINES: dict[str, Callable[[Points], UprightBox]] = {
    "clusters, smallest rectangles": smallest_rectangle,
    "clusters, L-shape fits": l_shape,
}
_Boxes = dict[tuple[int, str], tuple[UprightBox, ...]]  # of each baseline, by frame and track


@dataclass(frozen=True)
class Detection:
    """How well vehicles are found at one overlap; see `average_precision`."""

    kind: str
    iou: float
    average_precision: float | None
    recall_at_90: float | None


@dataclass(frozen=True)
class VehicleScore:
    """One labelled vehicle.

    Attributes:
        drive: which of the drives, from 0.
        track: its number in the labels.
        scans: in which it counts.
        found: of these, those in which a box hits it at an IoU of 0.5 in bird's eye view.
        tracks: those that belong to it.
    """

    drive: int
    track: int
    scans: int
    found: int
    tracks: tuple[str, ...]


@dataclass(frozen=True)
class RowScores:
    """One row of the table.

    Attributes:
        detections: at each overlap.
        labels: that count.
        boxes: found, of those that are asked for.
        hota: None where nothing is labelled.
        identity_switches: at an IoU of 0.5.
        size_bias_m: mean of found minus labelled length, width, height; None where nothing is
            found.
        vehicles: every labelled vehicle.
    """

    name: str
    detections: tuple[Detection, ...]
    labels: int
    boxes: int
    hota: Hota | None
    identity_switches: int
    purity: Purity
    size_bias_m: tuple[float, float, float] | None
    vehicles: tuple[VehicleScore, ...]


@dataclass(frozen=True)
class DriveScores:
    """An evaluation.

    Attributes:
        rows: ours first.
        trajectories: one a drive; None where one of the two trajectories is not known.
        corrections: one a drive; where its scans were corrected for motion, what of its labels.
        cameras: drives of which only what the labelled camera sees counts.
    """

    rows: tuple[RowScores, ...]
    trajectories: tuple[TrajectoryError | None, ...]
    corrections: tuple[Correction, ...]
    cameras: int


@dataclass(frozen=True)
class _Frame:
    """One frame of one drive, everything compared with everything."""

    drive: int
    found: tuple[Found, ...]
    labels: LabelledFrame
    overlaps: Overlaps
    excused: Bool[np.ndarray, "f"]

    @property
    def confidence(self) -> Float[np.ndarray, "f"]:
        return np.array([one.confidence for one in self.found], float)

    @property
    def counted(self) -> Bool[np.ndarray, "l"]:
        return np.array([label.counted for label in self.labels.labels], bool)

    def outcome(self, kind: str, iou: float) -> np.ndarray:
        """Of each found box; things that are no vehicles cannot be hit."""
        vehicles = np.array([label.vehicle for label in self.labels.labels], bool)
        overlap = (self.overlaps.bev if kind == "bev" else self.overlaps.space) * vehicles
        return match(self.confidence, overlap, self.counted, self.excused, iou)


def evaluate_drives(
    found: Sequence[FoundDrive],
    labelled: Sequence[LabelledDrive],
    at: Callable[[int], None] = lambda _: None,
) -> DriveScores:
    """All drives as one: confidences are compared over drives, tracks within them.

    Args:
        found: what was found.
        labelled: the labels of the same drives.
        at: told how many rows are done.

    Raises:
        BadInputError: nothing that counts is labelled, a drive was found in other scans than the
            labelled ones, or kept points or scans are damaged.
    """
    _check(found, labelled)
    for drive, labels in zip(found, labelled, strict=True):
        check_same_scans(drive.path, labels.scans)
    if not any(one.counted for drive in labelled for frame in drive.frames for one in frame.labels):
        raise BadInputError(
            f"{labelled[0].path}: no label counts: none is of a vehicle with"
            f" {labelled[0].counting.points} points; give labels with their scans."
        )
    others, samples = zip(*(_around_clusters(*one) for one in zip(found, labelled)))
    labelled, corrections = zip(*map(like_found, labelled, samples))
    rows = [_row(OURS, found, labelled)]
    at(1)
    for number, name in enumerate(BASELINES):
        refitted = [_refitted(drive, own, number) for drive, own in zip(found, others)]
        rows.append(_row(name, refitted, labelled))
        at(number + 2)
    errors = tuple(_trajectory(one, other) for one, other in zip(found, labelled, strict=True))
    cameras = sum(one.view is not None for one in labelled)
    return DriveScores(tuple(rows), errors, corrections, cameras)


def _check(found: Sequence[FoundDrive], labelled: Sequence[LabelledDrive]) -> None:
    """Refuse what Python hands in that is no list of drives and one of their labels."""
    for name, given, kind, reader in (
        ("found", found, FoundDrive, "read_found"),
        ("labelled", labelled, LabelledDrive, "read_labels"),
    ):
        several = expect(given, Sequence, name, f"pass a list of what {reader} gives")
        for one in several:
            expect(one, kind, name, f"{reader} makes one of a path")
    if len(found) != len(labelled) or not len(found):
        raise BadInputError(
            f"{len(found)} drives found, {len(labelled)} labelled; pass the labels of each drive."
        )


def _around_clusters(drive: FoundDrive, labels: LabelledDrive) -> tuple[_Boxes, Clusters]:
    """Each baseline's box around each cluster, and the clusters kept of `sampled_frames`."""
    sampled = sampled_frames(drive)
    boxes, sample = _Boxes(), {}
    for frame, track, points in kept_clusters(drive.path):
        boxes[frame, track] = _fitted(points)
        if frame in sampled:
            sample[frame, track] = points
    if not boxes:
        inside = points_inside(drive, labels.scans)
        boxes = {(frame, track): _fitted(points) for frame, track, points in inside}
    return boxes, sample


def _fitted(points: Points) -> tuple[UprightBox, ...]:
    return tuple(fit(points) for fit in BASELINES.values())


def _refitted(drive: FoundDrive, boxes: _Boxes, baseline: int) -> FoundDrive:
    """The same vehicles, as sure, with other boxes; where no point was seen there is none."""
    frames = tuple(
        tuple(
            replace(one, box=boxes[number, one.track][baseline])
            for one in frame
            if (number, one.track) in boxes
        )
        for number, frame in enumerate(drive.frames)
    )
    return replace(drive, frames=frames)


def _trajectory(found: FoundDrive, labelled: LabelledDrive) -> TrajectoryError | None:
    if found.T_world_sensor is None or labelled.T_world_sensor is None:
        return None
    return trajectory_error(found.T_world_sensor, labelled.T_world_sensor)


def _row(name: str, found: Sequence[FoundDrive], labelled: Sequence[LabelledDrive]) -> RowScores:
    frames = [
        _frame(number, boxes, labels, theirs)
        for number, (ours, theirs) in enumerate(zip(found, labelled, strict=True))
        for boxes, labels in zip(ours.frames, theirs.frames, strict=True)
    ]
    ranked = {(kind, iou): _ranked(frames, kind, iou) for kind in KINDS for iou in LEAST_IOU}
    pairs = _pairs(frames)
    asked = ranked["bev", 0.5].outcome
    return RowScores(
        name=name,
        detections=tuple(
            Detection(kind, iou, average_precision(one), recall_when_sure(one))
            for (kind, iou), one in ranked.items()
        ),
        labels=ranked["bev", 0.5].labels,
        boxes=int(np.isin(asked, (HIT, MISS)).sum()),
        hota=hota(pairs),
        identity_switches=identity_switches(pairs),
        purity=purity(pairs),
        size_bias_m=_size_bias(frames),
        vehicles=_vehicles(frames),
    )


def _frame(
    number: int, found: tuple[Found, ...], labels: LabelledFrame, drive: LabelledDrive
) -> _Frame:
    compared = overlaps([one.box for one in found], [label.box for label in labels.labels])
    idle = np.array([not label.counted for label in labels.labels], bool)
    on_idle = (compared.on[:, idle] >= drive.counting.on).any(1)
    unseen = np.array([_is_unseen(one.box, drive.view, labels) for one in found], bool)
    return _Frame(number, found, labels, compared, on_idle | unseen)


def _is_unseen(box: UprightBox, view: View | None, labels: LabelledFrame) -> bool:
    """Whether a box is where nobody labelled."""
    if view is None:
        return False
    picture = view.picture(box)
    if not view.sees(box) or picture is None:
        return True
    left, top, right, bottom = picture
    area = (right - left) * (bottom - top)
    wide = np.minimum(right, labels.regions[:, 2]) - np.maximum(left, labels.regions[:, 0])
    tall = np.minimum(bottom, labels.regions[:, 3]) - np.maximum(top, labels.regions[:, 1])
    shared = np.maximum(wide, 0) * np.maximum(tall, 0)
    return bool((shared >= view.counting.on * area).any())


def _ranked(frames: Sequence[_Frame], kind: str, iou: float) -> Ranked:
    return pooled(
        (frame.confidence, frame.outcome(kind, iou), int(frame.counted.sum())) for frame in frames
    )


def _pairs(frames: Sequence[_Frame]) -> list[Pairs]:
    """What counts of each frame, tracks numbered over all drives."""
    founds: dict[tuple[int, str], int] = {}
    trues: dict[tuple[int, int], int] = {}
    pairs = []
    for frame in frames:
        asked = np.flatnonzero(np.isin(frame.outcome("bev", 0.5), (HIT, MISS)))
        counted = np.flatnonzero(frame.counted)
        names = [(frame.drive, frame.found[i].track) for i in asked]
        labels = [(frame.drive, frame.labels.labels[i].track) for i in counted]
        pairs.append(
            Pairs(
                np.array([founds.setdefault(name, len(founds)) for name in names], int),
                np.array([trues.setdefault(label, len(trues)) for label in labels], int),
                frame.overlaps.bev[np.ix_(asked, counted)],
            )
        )
    return pairs


def _size_bias(frames: Sequence[_Frame]) -> tuple[float, float, float] | None:
    """Over all boxes that belong to a label that counts."""
    off = [
        np.subtract(frame.found[i].box[3:6], frame.labels.labels[j].box[3:6])
        for frame in frames
        for i, j in belonging(frame.overlaps.bev * frame.counted)
    ]
    if not off:
        return None
    length, width, height = np.mean(off, axis=0).tolist()
    return length, width, height


def _vehicles(frames: Sequence[_Frame]) -> tuple[VehicleScore, ...]:
    scores: dict[tuple[int, int], VehicleScore] = {}
    for frame in frames:
        bev = frame.overlaps.bev
        mine = {j: i for i, j in belonging(bev * frame.counted)}
        for j in np.flatnonzero(frame.counted).tolist():
            key = (frame.drive, frame.labels.labels[j].track)
            before = scores.get(key, VehicleScore(*key, 0, 0, ()))
            track = (frame.found[mine[j]].track,) if j in mine else ()
            hit = j in mine and bool(bev[mine[j], j] >= LEAST_IOU[0])
            tracks = tuple(sorted({*before.tracks, *track}))
            scores[key] = VehicleScore(*key, before.scans + 1, before.found + hit, tracks)
    return tuple(scores[key] for key in sorted(scores))
