# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What we add to the paper, taken away again, each alone: does it pay?"""

from dataclasses import replace
from typing import Any, NamedTuple

from experiments.tables.ablations import Part, changed
from experiments.tables.rows import small_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table, Trained

from wildshape.evaluation.results import Rotate
from wildshape.method.ray_encoder import RayConfig

_TURNS: tuple[Rotate, ...] = ("none", "yaw")


class Removal(NamedTuple):
    """A part of the method, and the values in one part of a recipe that leave it out."""

    name: str
    part: Part
    values: dict[str, Any]


REMOVED = (
    Removal("selector", "network", {"selector": False}),
    Removal("agreed headings", "loss", {"time_ordered": False, "agree_at": ()}),
    Removal("mirror", "network", {"mirror": False}),
    Removal("facing", "views", {"turn": "yaw", "roll": 0.0}),
)


def table(sources: Sources) -> Table:
    """Two trainings, the second taught by the first: of all parts, and of all but one."""
    title = "What we add, each part left out"
    notes = (
        "First round: without a teacher. Taught: by the fused tracks that the first round of the"
        " same parts poses.",
        "Refined, and all scans of a track: the taught weights, asked otherwise.",
    )
    return Table(title, (_drives(sources), _occluded(sources)), sources.size.ablation_seeds, notes)


def _drives(sources: Sources) -> Block:
    first = small_form(sources.size, sources.drives("train"))
    taught = replace(first, teacher=first)
    rows = [
        replace(first, name="first round, full"),
        *(_without(first, "first round", removal) for removal in REMOVED),
        replace(taught, name="taught, full"),
        replace(taught, name="taught, refined", answer="refined"),
        replace(taught, name="taught, all scans of the track", answer="track"),
    ]
    for removal in REMOVED:
        less = _without(first, "taught", removal)
        rows.append(replace(less, teacher=less))
    rows.append(replace(first, name="taught twice", teacher=taught))
    return Block("Simulated drives, ours", sources.drives("test"), tuple(rows), (), _TURNS)


def _occluded(sources: Sources) -> Block:
    """Drives past what stands in the way, with rays and without."""
    first = small_form(sources.size, sources.occluded("train"))
    taught = replace(first, teacher=first)
    rows = (
        replace(taught, name="taught, scans alone"),
        changed(taught, "taught, with rays", "network", rays=RayConfig()),
    )
    return Block("Simulated drives with occluders, ours", sources.occluded("test"), rows)


def _without(row: Trained, form: str, removal: Removal) -> Trained:
    return changed(row, f"{form}, w/o {removal.name}", removal.part, **removal.values)
