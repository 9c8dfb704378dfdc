# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""RGB-D frames with instance masks: depth images of anybody's camera become tracks.

    ROOT/SEQUENCE/camera.json          fx fy cx cy, depth_scale: units of the PNG a metre
    ROOT/SEQUENCE/depth/NAME.png       16 bits, 0: not measured; sorted by name = in time order
    ROOT/SEQUENCE/masks/NAME.png       instance numbers, 0: background; or
    ROOT/SEQUENCE/masks/ID/NAME.png    a folder an instance, not 0: the object
    ROOT/SEQUENCE/poses.txt            optional: T_world_camera, 12 numbers a line, a line a depth
    ROOT/SEQUENCE/objects.json         optional: {"ID": "category"}

Nothing is known about the objects' poses, and nothing needs to be.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from wildshape.datasets.rgbd.depth_image import read_png, supported
from wildshape.datasets.rgbd.sequence import Sequence, instances_of, open_sequence
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.parts import found_in
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan, sight_lines
from wildshape.geometry.projection.pinhole import back_project
from wildshape.records import Intrinsics, Points, Sensor, SightLines, Track


@dataclass(frozen=True)
class Cut:
    """How an object's points are cut out of a depth image.

    Attributes:
        edge: so many pixels at the mask's border are left out: masks are never exact, and depth
            between an object and what is behind it hangs in the air.
        jump: inside, a pixel is left out unless three of its neighbours are within this share of
            its depth.
        max_depth: farther pixels are left out, metres.
        most_points: of a scan; more are thinned, by chance with a fixed seed.
    """

    edge: int = 1
    jump: float = 0.02
    max_depth: float = float("inf")
    most_points: int = 4096


@dataclass
class Rgbd:
    """Depth images with masks; a part is a sequence.

    Attributes:
        root: a folder of sequences, or one.
        selection: which objects and scans; categories are the words of objects.json.
        gap: an object that is not seen for more than so many frames begins a new track, and so
            does one at `longest` scans: memory stays flat however long a sequence is.
        longest: most scans of a track.
        rays: with each scan keep the rays of its frame that passed the object by, too.
        doubts: on the camera of the sequence that was read last.
    """

    root: Path
    selection: Selection = Selection()
    cut: Cut = Cut()
    gap: int = 100
    longest: int = 300
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)
    doubts: tuple[str, ...] = field(default=(), init=False)

    def parts(self) -> list[str]:
        """The sequences: folders with depth/ in them.

        Raises:
            BadInputError: there is none.
        """
        root = Path(self.root)
        if (root / "depth").is_dir():
            return ["."]
        sequences = sorted(depth.parent.name for depth in root.glob("*/depth") if depth.is_dir())
        if not sequences:
            raise BadInputError(
                f"{root}: expected folders with camera.json, depth and masks in them,"
                f" {found_in(root)}."
            )
        return sequences

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a sequence, each once its object has not been seen for `gap` frames.

        Raises:
            BadInputError: camera.json, a depth image, a mask or poses.txt is missing or damaged.
        """
        sequence = open_sequence(Path(self.root) / part)
        self.doubts = (sequence.doubt,) if sequence.doubt else ()
        sensor = Sensor("camera", intrinsics=sequence.camera)
        gathering = Gathering(self.selection, sensor, self.rejected, rays=self.rays)
        names = Names(self.gap, self.longest * self.selection.every)
        for frame, path in enumerate(sequence.depth):
            self._add_frame(sequence, frame, path, gathering, names)
            yield from gathering.finished(before=frame - self.gap)
        yield from gathering.finished()

    def _add_frame(
        self, sequence: Sequence, frame: int, path: Path, to: Gathering, names: "Names"
    ) -> None:
        masks = to.read(lambda: dict(self._wanted(sequence, path)), 1)
        if masks is None:
            return
        chosen = {}
        for instance, mask in masks.items():
            name = names.of(f"{sequence.name}_{instance:05d}", frame)
            category, source = sequence.categories.get(instance, ""), f"RGB-D {sequence.name}"
            if to.wants(name, frame, category=category, source=source):
                chosen[name] = mask
        depth = to.read(partial(sequence.read_depth, path), len(chosen))
        if depth is None:
            return
        for name, mask in chosen.items():
            points = cut_out(depth, mask, sequence.camera, self.cut)
            place = sequence.place(frame, points)
            rays = partial(rays_beside, depth, mask, sequence.camera)
            to.add(name, path.stem, points, place=place, rays=rays)

    def _wanted(
        self, sequence: Sequence, path: Path
    ) -> Iterator[tuple[int, Bool[np.ndarray, "h w"]]]:
        files = sequence.masks(path.stem)
        if not files:
            self.rejected["frame: no mask"] += 1
        for instance, file in files:
            mask = read_png(file, "a PNG mask of one channel")
            sequence.check_size(mask, file)
            if not mask.any():
                self.rejected["mask: empty"] += 1
            for number, inside in instances_of(mask, instance):
                category = sequence.categories.get(number, "")
                if self.selection.categories and category not in self.selection.categories:
                    self.rejected[f"scan: category {category or 'unknown'}"] += 1
                else:
                    yield number, inside


def cut_out(
    depth: Float[np.ndarray, "h w"], mask: Bool[np.ndarray, "h w"], camera: Intrinsics, cut: Cut
) -> Points:
    """The points of a mask that lie on its object, camera frame, metres."""
    from scipy.ndimage import binary_erosion

    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return np.zeros((0, 3), np.float32)
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    near, inside = depth[window], mask[window]
    if cut.edge > 0:
        inside = np.asarray(binary_erosion(inside, iterations=cut.edge), bool)
    inside = inside & (near > 0) & (near <= cut.max_depth)
    kept = np.zeros(depth.shape)
    kept[window] = np.where(supported(near, inside, cut.jump), near, 0.0)
    points = back_project(kept, camera)
    if len(points) <= cut.most_points:
        return points
    chosen = np.random.default_rng(0).choice(len(points), cut.most_points, replace=False)
    return points[np.sort(chosen)]


def rays_beside(
    depth: Float[np.ndarray, "h w"], mask: Bool[np.ndarray, "h w"], camera: Intrinsics
) -> SightLines | None:
    """The rays of the pixels around a mask, camera frame; infinite where there is no depth."""
    seen = np.isfinite(depth) & (depth > 0)
    lost = back_project(np.where(seen | mask, 0.0, 1.0), camera)
    lost = lost / np.linalg.norm(lost, axis=1, keepdims=True)
    rows = np.flatnonzero(mask[seen])
    return sight_lines(FullScan(back_project(depth, camera), lost=lost), rows)


class Names:
    """Names of tracks: an object's own, and which of its tracks it is.

    Attributes:
        gap: an object that is not seen for more than so many frames begins a new track.
        longest: most frames of a track.
    """

    def __init__(self, gap: int, longest: int) -> None:
        """No object yet."""
        self.gap, self.longest = gap, longest
        self._seen: dict[str, tuple[int, int, int]] = {}  # track, offers, last frame

    def of(self, thing: str, frame: int) -> str:
        """The track that a frame of an object belongs to: `mug`, `mug_1` later on."""
        track, offers, last = self._seen.get(thing, (0, 0, frame))
        if frame - last - 1 > self.gap or offers >= self.longest:
            track, offers = track + 1, 0
        self._seen[thing] = (track, offers + 1, frame)
        return thing + (f"_{track}" if track else "")
