# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Data sets in the BOP format (Hodan et al.): depth images, masks and poses become tracks.

    ROOT/SPLIT/000001/scene_camera.json   cam_K and depth_scale of each image; perhaps cam_R_w2c
    ROOT/SPLIT/000001/scene_gt.json       obj_id, cam_R_m2c, cam_t_m2c (mm) of each object in it
    ROOT/SPLIT/000001/depth/000000.png    times depth_scale: millimetres
    ROOT/SPLIT/000001/mask_visib/000000_000000.png    image _ number in scene_gt's list
    ROOT/models*/obj_000001.ply           optional: the objects' meshes, mm

The object frame is the model's own.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from wildshape.datasets.rgbd.bop_scene import Frame, Scene, Thing, model_shape, open_scene
from wildshape.datasets.rgbd.depth_image import read_png
from wildshape.datasets.rgbd.reader import Cut, Names, cut_out, rays_beside
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.parts import found_in
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.records import Sensor, Track


@dataclass
class Bop:
    """Objects of a BOP data set; a part is a scene.

    Attributes:
        root: the data set, one of its splits, or one scene.
        selection: which objects and scans; categories are such as `obj_000005`.
        shapes: whether to sample the true shapes from the models.
        shape_points: of a true shape.
        longest: most scans of a track, and most frames in which an object may be unseen before its
            track ends: memory stays flat however long a scene is.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    cut: Cut = Cut()
    shapes: bool = True
    shape_points: int = 8192
    longest: int = 300
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The scenes, by their folders below the root: folders with scene_gt.json.

        Raises:
            BadInputError: there is none.
        """
        root = Path(self.root)
        depths = ("scene_gt.json", "*/scene_gt.json", "*/*/scene_gt.json")
        found = sorted(file.parent for pattern in depths for file in root.glob(pattern))
        if not found:
            raise BadInputError(
                f"{root}: expected a BOP data set, split or scene (scene_gt.json in folders such"
                f" as test/000001), {found_in(root)}."
            )
        return [file.relative_to(root).as_posix() for file in found]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a scene, one an object; several where it is seen, or unseen, beyond `longest`.

        An object that occurs more than once in an image is told from its likes by the order of
        scene_gt's list, which data sets keep from image to image.

        Raises:
            BadInputError: a file of the scene is missing or damaged.
        """
        scene = open_scene(Path(self.root) / part)
        gathering = Gathering(
            self.selection, Sensor("camera", intrinsics=scene.camera), self.rejected, rays=self.rays
        )
        names = Names(self.longest, self.longest * self.selection.every)
        for number, frame in enumerate(scene.frames):
            chosen = []
            for thing in self._wanted(frame):
                name = names.of(_name(part, thing), number)
                source = f"BOP {scene.folder.resolve().parent.name}"
                words = {"category": thing.category, "source": source}
                if gathering.wants(name, number, **words):
                    chosen.append((name, thing))
            self._crop_frame(scene, frame, chosen, gathering)
            yield from self._shaped(gathering.finished(before=number - self.longest), scene)
        yield from self._shaped(gathering.finished(), scene)

    def _wanted(self, frame: Frame) -> list[Thing]:
        wanted = self.selection.categories
        kept = [t for t in frame.things if not wanted or t.category in wanted]
        for thing in frame.things:
            if thing not in kept:
                self.rejected[f"scan: category {thing.category}"] += 1
        return kept

    def _crop_frame(
        self, scene: Scene, frame: Frame, chosen: list[tuple[str, Thing]], to: Gathering
    ) -> None:
        depth = None
        for name, thing in chosen:
            try:
                depth = scene.read_depth(frame) if depth is None else depth
                self._add(scene, frame, thing, name, depth, to)
            except BadInputError as damage:
                to.damage.miss("scan", damage)

    def _add(
        self, scene: Scene, frame: Frame, thing: Thing, name: str, depth: np.ndarray, to: Gathering
    ) -> None:
        path = scene.folder / "mask_visib" / f"{frame.stem}_{thing.number:06d}.png"
        if not path.is_file():
            raise BadInputError(f"{path}: no such file; the split's archive of BOP brings masks.")
        mask = read_png(path, "a PNG mask of one channel") != 0
        if mask.shape != depth.shape:
            raise BadInputError(f"{path}: {mask.shape} pixels, its depth image has {depth.shape}.")
        camera = replace(frame.camera, height=depth.shape[0], width=depth.shape[1])
        points = cut_out(depth, mask, camera, self.cut)
        place = None
        if frame.T_camera_world is not None:
            T_world_object = frame.T_camera_world.inverse() @ thing.T_camera_object
            place = T_world_object.translation.numpy()
        rays = partial(rays_beside, depth, mask, camera)
        to.add(name, frame.stem, points, thing.T_camera_object, place, rays=rays)

    def _shaped(self, tracks: Iterator[Track], scene: Scene) -> Iterator[Track]:
        for track in tracks:
            if not self.shapes:
                yield track
                continue
            shape = model_shape(scene.folder, track.category, self.shape_points)
            yield replace(track, shape=shape)


def _name(part: str, thing: Thing) -> str:
    """For example `test_000001_obj000005`, `..._obj000005-1` of a second one."""
    likes = "" if thing.like == 0 else f"-{thing.like}"
    words = "" if part == "." else part.replace("/", "_") + "_"
    return f"{words}obj{thing.object:06d}{likes}"
