# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What we add to the paper, taken away again, each alone: does it pay?"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from experiments.tables.ablations import Part, changed
from experiments.tables.given import Given
from experiments.tables.rows import small_form
from experiments.tables.table import Block, Table, Trained

from wildshape.evaluation.results import Rotate
from wildshape.method.ray_encoder import RayConfig

_TURNS: tuple[Rotate, ...] = ("none", "yaw")


class Removal(NamedTuple):
    """A part of the method, and how a row does without it."""

    name: str
    of: Callable[[Trained], Trained]


REMOVED = (
    Removal("selector", lambda row: _less(row, "network", selector=False)),
    Removal("agreed headings", lambda row: _less(row, "loss", time_ordered=False, agree_at=())),
    Removal("mirror", lambda row: _less(row, "network", mirror=False)),
    Removal("facing", lambda row: _less(row, "views", turn="yaw", roll=0.0)),
)
"""The network's parts, those first that are suspected not to pay."""


def table(given: Given) -> Table:
    """Two trainings, the second taught by the first: of all parts, and of all but one."""
    title = "What we add, each part left out"
    notes = (
        "First round: without a teacher. Taught: by the fused tracks that the first round of the"
        " same parts poses.",
        "Refined, and all scans of a track: the taught weights, asked otherwise.",
    )
    return Table(title, (_drives(given), _occluded(given)), given.size.ablation_seeds, notes)


def _drives(given: Given) -> Block:
    first = small_form(given.size, given.drives("train"))
    taught = replace(first, teacher=first)
    rows = [
        replace(first, name="first round, full"),
        *(_without(first, "first round", removal) for removal in REMOVED),
        replace(taught, name="taught, full"),
        replace(taught, name="taught, refined", answer="refined"),
        replace(taught, name="taught, all scans of the track", answer="track"),
    ]
    for removal in REMOVED:
        less = removal.of(first)
        rows.append(_without(replace(less, teacher=less), "taught", removal))
    rows.append(replace(first, name="taught twice", teacher=taught))
    return Block("Simulated drives, ours", given.drives("test"), tuple(rows), (), _TURNS)


def _occluded(given: Given) -> Block:
    """Drives past what stands in the way, with rays and without."""
    first = small_form(given.size, given.occluded("train"))
    taught = replace(first, teacher=first)
    rows = (
        replace(taught, name="taught, scans alone"),
        replace(_less(taught, "network", rays=RayConfig()), name="taught, with rays"),
    )
    return Block("Simulated drives with occluders, ours", given.occluded("test"), rows)


def _without(row: Trained, form: str, removal: Removal) -> Trained:
    return replace(removal.of(row), name=f"{form}, w/o {removal.name}")


def _less(row: Trained, part: Part, **values: object) -> Trained:
    """The row with another value in one part of its recipe, under the same name."""
    return changed(row, row.name, part, **values)
