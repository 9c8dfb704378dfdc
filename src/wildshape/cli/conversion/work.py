# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A whole conversion: its parts shared out over cores or a cluster, then put together."""

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wildshape.cli.conversion.output import Destination, PackedStore, TrackFolders, left_out
from wildshape.cli.options import Layout
from wildshape.cli.terminal import counted, progress
from wildshape.datasets.tracks.conversion import Conversion, Part, PartResult
from wildshape.datasets.tracks.source import Source
from wildshape.datasets.tracks.truth import TruthBuilder
from wildshape.errors import BadInputError, MissingExtraError
from wildshape.io.store.layout import PARTS
from wildshape.parallel.processes import as_done
from wildshape.parallel.ray_cluster import on_ray


@dataclass(frozen=True)
class Order:
    """A conversion that is wanted.

    Attributes:
        name: of the data set, for people.
        source: the data set.
        out: where the tracks go.
        layout: as one store or as folders.
        truth: what makes shapes from poses, if anything.
        settings: JSON values; what decides the tracks beside `layout` and `truth`.
        workers: processes; None: one a core.
        ray: address of a Ray cluster instead, if any.
        overwrite: replace an earlier output.
    """

    name: str
    source: Source
    out: Path
    layout: Layout
    truth: TruthBuilder | None
    settings: dict[str, Any]
    workers: int | None = None
    ray: str | None = None
    overwrite: bool = False


def convert(order: Order) -> list[PartResult]:
    """Convert all parts, or those that an earlier run did not finish; their results in order.

    The output depends on the data set and the settings alone, not on who worked on what when.

    Raises:
        BadInputError: the data set or the output cannot be used, or no track came.
        MissingExtraError: Ray is not installed.
    """
    parts = [Part(i, name) for i, name in enumerate(order.source.parts())]
    settings = json.loads(json.dumps(_identity(order, parts), default=str), parse_constant=str)
    kind = PackedStore if order.layout == "packed" else TrackFolders
    destination: Destination = kind(order.out, settings, order.overwrite)
    earlier = destination.begin()
    if earlier is not None:
        return earlier
    task = Conversion(order.source, (order.out / PARTS).absolute(), order.layout, order.truth)
    try:
        results = _all_parts(task, parts, order)
    except (BadInputError, MissingExtraError):
        if not any(task.finished(part) for part in parts):
            destination.abandon()
        raise
    if not any(result.tracks for result in results):
        destination.abandon()
        raise BadInputError(_nothing(order, results))
    destination.finish([(task.place(part), result) for part, result in zip(parts, results)])
    return results


def _identity(order: Order, parts: list[Part]) -> dict[str, Any]:
    """All that decides the output; parts are part of it, lest a data set grows between two runs."""
    names = "\n".join(part.name for part in parts).encode("utf-8", "surrogatepass")
    return {
        **order.settings,
        "layout": order.layout,
        "truth": asdict(order.truth) if order.truth else None,
        "parts": {
            "count": len(parts),
            "names": hashlib.sha256(names).hexdigest()[:16],
        },
    }


def _all_parts(task: Conversion, parts: list[Part], order: Order) -> list[PartResult]:
    """The results in order, of this run and of earlier ones; progress is shown."""
    found = {part: task.finished(part) for part in parts}
    results = {part: result for part, result in found.items() if result is not None}
    todo = [part for part in parts if part not in results]
    with progress(f"converting {order.name}", len(parts), start=len(results)) as bar:
        for part, result in _shared_out(task, todo, order):
            results[part] = result
            so_far = list(results.values())
            refused = all(r.damage for r in so_far) or len(so_far) == len(parts)
            if not refused or any(r.tracks for r in so_far):
                bar.at(len(so_far), _so_far(so_far))
    return [results[part] for part in parts]


def _shared_out(
    task: Conversion, todo: list[Part], order: Order
) -> Iterator[tuple[Part, PartResult]]:
    cores = os.cpu_count() or 1
    workers = min(cores if order.workers is None else order.workers, len(todo))
    if order.ray is not None and todo:
        return on_ray(task, todo, order.ray, order.workers)
    return as_done(task, todo, workers) if workers > 1 else map(task, todo)


def _so_far(results: list[PartResult]) -> str:
    tracks, scans = sum(r.tracks for r in results), sum(r.scans for r in results)
    return f"{counted(tracks, 'track')}, {counted(scans, 'scan')}"


def _nothing(order: Order, results: list[PartResult]) -> str:
    damaged = [result.damage for result in results if result.damage]
    if len(damaged) == len(results) > 0:
        others = f" (and {len(damaged) - 1} more parts are damaged)" if len(damaged) > 1 else ""
        return f"{damaged[0].rstrip('.')}{others}."
    reasons = left_out(results)
    # Of equals the cause: an object has no scans left because they were left out.
    most = max(reasons, key=lambda why: (reasons[why], why.startswith("scan")), default="")
    why = f" (most often, {reasons[most]} times: {most.rstrip('.')})" if most else ""
    root = order.settings.get("root", order.name)
    return f"{root}: no track came out of the source{why}; check it and its options."
