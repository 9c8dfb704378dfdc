# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the user gives a table, and the data sets that are made of it."""

from dataclasses import dataclass, replace
from pathlib import Path

from experiments.tables.data import Cad, Kitti, Simulated, Split
from experiments.tables.size import Size

from wildshape.errors import BadInputError
from wildshape.simulate.config import Category
from wildshape.simulate.generate import SimulationConfig

_SEEDS: dict[Split, int] = {"train": 1, "test": 9002}
TRUCKS = 14
_OCCLUDED, _RAYS = 0.5, 512


@dataclass(frozen=True)
class Sources:
    """Size, and folders that are not part of the project.

    Attributes:
        size: of the table.
        cad: meshes with a manifest, split by model; None: our procedural shapes.
        kitti: KITTI raw, the folder above the dates.
    """

    size: Size
    cad: Path | None = None
    kitti: Path | None = None

    def drives(self, split: Split) -> Simulated:
        """Cars driven past, as recorded by a 64-beam LiDAR."""
        count = self.size.train if split == "train" else self.size.test
        config = SimulationConfig(tracks=count)
        return Simulated(f"cars-{split}", config, _SEEDS[split], self._cad(("car",), split))

    def occluded(self, split: Split) -> Simulated:
        """The same past what stands in the way, the rays beside each car kept with its scans."""
        plain = self.drives(split)
        config = replace(plain.config, occlusion=_OCCLUDED, rays=_RAYS)
        return replace(plain, name=f"occluded-{plain.name}", config=config)

    def views(self, category: Category, split: Split, noise: float | None = None) -> Simulated:
        """Depth views of unit-sized objects, five each; `noise` is the sigma of depths."""
        count = self.size.train if split == "train" else self.size.test
        config = SimulationConfig(
            tracks=count, sensor="depth-camera", category=category, noise_m=noise
        )
        cad, name = self._cad((category,), split), "noisy-views" if noise else "views"
        return Simulated(f"{category}-{name}-{split}", config, _SEEDS[split], cad)

    def trucks(self) -> Simulated:
        """As many trucks as the paper had.

        Raises:
            BadInputError: no CAD folder given.
        """
        if self.cad is None:
            raise BadInputError("the trucks of this table are CAD meshes: give --cad FOLDER.")
        config = SimulationConfig(tracks=min(TRUCKS, 4 * self.size.test))
        return Simulated("trucks", config, 9003, self._cad(("truck",), "test"))

    def real_cars(self) -> Kitti:
        """Cars of KITTI raw.

        Raises:
            BadInputError: no folder given.
        """
        if self.kitti is None:
            raise BadInputError("this table measures real cars: give --kitti FOLDER (KITTI raw).")
        return Kitti("kitti", self.kitti)

    def _cad(self, categories: tuple[str, ...], split: Split) -> Cad | None:
        return None if self.cad is None else Cad(self.cad, categories, split)
