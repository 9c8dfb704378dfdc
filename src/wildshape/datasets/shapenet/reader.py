# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""ShapeNet renders in the layout of DPC (Insafutdinov & Dosovitskiy 2018) become tracks.

The paper's synthetic data: a model is a track, its five random depth views are the scans. The
object frame is the world of the renderer, Blender: the OBJ file's (x, y, z) is its (x, -z, y), so
that ShapeNet v1's front, +x, looks forward and its up, +y, is z.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from wildshape.datasets.shapenet.files import View, read_model_list, read_shape, read_view
from wildshape.datasets.tracks.gathering import Damage
from wildshape.datasets.tracks.parts import found_in, groups, members
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.projection.pinhole import back_project
from wildshape.geometry.transforms.se3 import stack
from wildshape.records import Points, Sensor, Track

CATEGORIES = {"02691156": "airplane", "02958343": "car", "03001627": "chair"}
SPLITS = ("train", "val", "test")
Split = Literal["train", "val", "test", "all"]


@dataclass
class ShapeNetViews:
    """Depth views of ShapeNet models; a part is some models of one category and split.

    Attributes:
        root: DPC's `data` folder, with `renders`, `splits` and, for the truth, `gt`.
        selection: which objects and scans; categories are words (`chair`) or synsets.
        split: whose lists of models are read.
        views: a model's first so many depth images, in the order of their names, as DPC takes.
        pixels: of a larger image only so many rows and columns are taken, the nearest ones, as
            DPC does for its 128; 0 takes all. Its points stay on the rays of their own pixels.
    """

    root: Path
    selection: Selection = Selection()
    split: Split = "all"
    views: int = 5
    pixels: int = 128
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """For example `03001627_train_000000-000031`: numbers in the split's list.

        Raises:
            BadInputError: no renders of a category that is wanted, or no list of a split.
        """
        splits = SPLITS if self.split == "all" else (self.split,)
        return [
            f"{synset}_{split}_{group}"
            for synset in self._synsets()
            for split in splits
            for group in groups(len(self._models(synset, split)))
        ]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """A track a model, in the order of the list.

        Raises:
            BadInputError: no such part, or a view lacks its camera or is damaged.
        """
        synset, split, group = (*part.split("_"), "", "")[:3]
        if synset not in CATEGORIES or split not in SPLITS:
            raise BadInputError(f"part '{part}': expected such as 03001627_train_000000-000031.")
        models = self._models(synset, split)
        damage = Damage(self.rejected)
        for number in members(group):
            try:
                track = self._track(synset, split, models[number])
            except BadInputError as error:
                damage.miss("object", error)
                continue
            damage.read += 1
            if track is not None:
                yield track
        damage.settle()

    def _synsets(self) -> list[str]:
        """The categories that are wanted and there."""
        renders = Path(self.root) / "renders"
        if not renders.is_dir():
            raise BadInputError(
                f"{self.root}: expected DPC's data folder with renders and splits in it,"
                f" {found_in(self.root)}."
            )
        wanted = [synset_of(name) for name in self.selection.categories] or list(CATEGORIES)
        there = [synset for synset in wanted if (renders / synset).is_dir()]
        if not there:
            raise BadInputError(
                f"{renders}: holds none of {', '.join(wanted)}; DPC's download_train_data.sh"
                " brings a synset's renders."
            )
        return there

    def _models(self, synset: str, split: str) -> list[str]:
        return read_model_list(Path(self.root) / "splits" / f"{synset}_{split}.txt")

    def _track(self, synset: str, split: str, model: str) -> Track | None:
        folder = Path(self.root) / "renders" / synset / model
        files = sorted(folder.glob("depth_*.png"), key=lambda file: file.name)
        if not files:
            self.rejected["object: no depth views"] += 1
            return None
        kept: list[tuple[View, Points]] = []
        for file in files[: self.views : self.selection.every]:
            view = reduced(read_view(file), self.pixels)
            points = back_project(view.depth, view.camera)
            objection = self.selection.objection_to_scan(points)
            if objection:
                self.rejected[objection] += 1
            else:
                kept.append((view, points))
        track = Track(
            name=f"{synset}_{model}",
            scans=tuple(points for _, points in kept),
            scan_names=tuple(view.name for view, _ in kept),
            sensor=Sensor("camera", intrinsics=kept[0][0].camera if kept else None),
            category=CATEGORIES[synset],
            source=f"ShapeNet views {split}",
            T_sensor_object=stack([view.T_camera_world for view, _ in kept]) if kept else None,
            shape=read_shape(Path(self.root) / "gt", synset, model),
        )
        objection = self.selection.objection_to_track(track, None)
        if objection:
            self.rejected[objection] += 1
        return None if objection else track


def synset_of(name: str) -> str:
    """The synset of a category given by its word or its synset.

    Raises:
        BadInputError: DPC has no such category.
    """
    by_word = {word: synset for synset, word in CATEGORIES.items()}
    if name not in CATEGORIES and name not in by_word:
        raise BadInputError(
            f"'{name}' is no category of DPC's data; there are {', '.join(by_word)}."
        )
    return by_word.get(name, name)


def reduced(view: View, pixels: int) -> View:
    """A view thinned to `pixels` rows and columns, its camera as it was."""
    height, width = view.depth.shape
    if not 0 < pixels < width:
        return view
    keep = np.zeros((height, width), bool)
    rows, columns = (((np.arange(pixels) + 0.5) * n / pixels).astype(int) for n in (height, width))
    keep[np.ix_(rows, columns)] = True
    return replace(view, depth=np.where(keep, view.depth, np.inf))
