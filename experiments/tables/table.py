# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A table as a value: blocks of rows, each block measured on one data set."""

from dataclasses import dataclass
from typing import Literal

from experiments.tables.data import Data, key

from wildshape.baselines.dpc.objective import DpcRecipe
from wildshape.evaluation.paper import PaperRow
from wildshape.evaluation.results import Rotate
from wildshape.training.config import Recipe

Answer = Literal["raw", "refined", "track", "canonical"]
PROTOCOLS: tuple[Rotate, ...] = ("none", "yaw", "so3")


@dataclass(frozen=True)
class Trained:
    """A row that is trained here, once a seed.

    Attributes:
        name: of the row.
        recipe: of the training; DPC's has neither teacher nor start.
        data: trained on, without labels unless the teacher is the truth.
        teacher: whose poses and shapes are taught (same seed); `truth`: the oracle.
        start: whose weights are fine-tuned (same seed).
        answer: what is measured: the network's own answer, the same refined against its scan, what
            all scans of a track say together, or shapes alone, in the object's own frame.
    """

    name: str
    recipe: Recipe | DpcRecipe
    data: Data
    teacher: "Trained | Literal['truth'] | None" = None
    start: "Trained | None" = None
    answer: Answer = "raw"

    @property
    def key(self) -> str:
        """The same for rows of any name that are trained alike."""
        teacher = self.teacher.key if isinstance(self.teacher, Trained) else self.teacher
        return key(self.recipe, self.data, teacher, self.start.key if self.start else None)


@dataclass(frozen=True)
class Baseline:
    """A row of `wildshape evaluate --baselines`."""

    name: str


@dataclass(frozen=True)
class Shipped:
    """The weights that the package carries."""

    name: str = "shipped weights"


Row = Trained | Baseline | Shipped


@dataclass(frozen=True)
class Block:
    """Rows measured on one data set, and the paper's rows to stand beside them.

    Attributes:
        title: of the block.
        test: measured on.
        rows: ours.
        paper: printed by the paper; shown under scans as recorded.
        rotate: input protocols.
        percent: objects are of unit size, and CD is printed times 100.
        accumulated: truth is made of the track's scans, as the paper makes it, and not known.
    """

    title: str
    test: Data
    rows: tuple[Row, ...]
    paper: tuple[PaperRow, ...] = ()
    rotate: tuple[Rotate, ...] = ("none",)
    percent: bool = False
    accumulated: bool = False


@dataclass(frozen=True)
class Table:
    """What is to be made.

    Attributes:
        title: with the paper's number.
        blocks: in order.
        seeds: trainings of each row, and turns of each baseline.
        notes: what a reader must know.
    """

    title: str
    blocks: tuple[Block, ...]
    seeds: int
    notes: tuple[str, ...] = ()
