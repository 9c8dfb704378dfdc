# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Finished stores become one: their shards are renamed, their indexes follow each other.

No point is read. Until the parts' shards begin to move, the parts are whole; from then on
`joining.json` says which file goes where, so that a join that was killed can be gone on with.
"""

import json
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.atomic import write_json
from wildshape.io.guard import reading
from wildshape.io.store.index import IndexWriter
from wildshape.io.store.layout import (
    EXTRAS,
    INDEX,
    INDEX_JSON,
    JOINING_JSON,
    PARTS,
    SHAPE_KINDS,
    SHARD_NAME,
    WRITING_JSON,
    FileRecord,
)
from wildshape.io.store.manifest import check_seal, is_sealed, manifest_of, read_manifest, sealed
from wildshape.io.store.store import Store
from wildshape.io.store.writer import remove_store

_TEXTS = ("track_names", "categories", "sources", "sensors", "scan_names")
_POINTS = ("scan_starts", "shape_starts", "ray_starts")


def is_joining(out: Path) -> bool:
    """Whether a join was stopped after the parts' shards had begun to move."""
    return (out / JOINING_JSON).is_file()


def join_stores(parts: Sequence[Path], out: Path, provenance: dict[str, Any]) -> None:
    """Make one store of several, in their order; they are used up.

    They lie below `out` in `.parts`, which is removed; an older store at `out` is replaced.

    Raises:
        BadInputError: two tracks have one name, or a part is damaged.
        OSError: the disk is full; the parts are as they were.
    """
    manifests = [read_manifest(part) for part in parts]
    _check_names(parts)
    shards = [FileRecord(**shard) for manifest in manifests for shard in manifest["shards"]]
    renamed = [replace(s, file=SHARD_NAME.format(i)) for i, s in enumerate(shards)]
    places = [part / shard["file"] for part, m in zip(parts, manifests) for shard in m["shards"]]
    counts = {key: sum(m[key] for m in manifests) for key in ("tracks", "scans", "points")}
    remove_store(out, parts=False)
    index = _join_indexes(parts, out)
    moves = [
        [str(place.absolute().relative_to(out.absolute())), s.file]
        for place, s in zip(places, renamed)
    ]
    manifest = manifest_of(index, renamed, counts, provenance)
    write_json(out / JOINING_JSON, sealed({"moves": moves, "manifest": manifest}), flush=True)
    finish_join(out)


def finish_join(out: Path) -> dict[str, Any]:
    """Go on with a join whose `joining.json` is written; returns what `index.json` says.

    Raises:
        BadInputError: a shard is neither where it was nor where it goes.
    """
    with reading(out / JOINING_JSON, "the plan of a join"):
        plan = json.loads((out / JOINING_JSON).read_text("utf-8"))
        if not is_sealed(plan):
            raise ValueError("it has no checksum")
        check_seal(out / JOINING_JSON, plan)
        moves, manifest = _inside(plan["moves"]), plan["manifest"]
    # Each step can be repeated; what the parts say of themselves is in the plan.
    for source, target in moves:
        if (out / source).is_file():
            (out / source).replace(out / target)
        elif not (out / target).is_file():
            raise BadInputError(f"{out / source}: lost; write the store again with --overwrite.")
    shutil.rmtree(out / PARTS, ignore_errors=True)
    write_json(out / INDEX_JSON, manifest, flush=True)
    (out / WRITING_JSON).unlink(missing_ok=True)
    (out / JOINING_JSON).unlink()
    return manifest


def _inside(moves: list[list[str]]) -> list[list[str]]:
    """The moves, which lead from the parts to a shard's name and nowhere else."""
    for number, (source, target) in enumerate(moves):
        steps = Path(source).parts
        if steps[0] != PARTS or ".." in steps or target != SHARD_NAME.format(number):
            raise ValueError(f"no move of a shard: {source} to {target}")
    return moves


def _check_names(parts: Iterable[Path]) -> None:
    seen: set[str] = set()
    for part in parts:
        for name in Store(part).names:
            if name in seen:
                raise BadInputError(f"two tracks are named '{name}'; rename one of them.")
            seen.add(name)


def _join_indexes(parts: Iterable[Path], out: Path) -> FileRecord:
    writer = IndexWriter(out)
    try:
        for part in parts:
            _append(writer, Store(part))
        return writer.finish()
    except BaseException:
        writer.abandon()
        raise


def _append(writer: IndexWriter, part: Store) -> None:
    """The index of a part, its numbers moved on by what is there already."""
    points = writer.last("shard_starts")
    bases = {
        **dict.fromkeys(_TEXTS, writer.count("text_starts") - 1),
        **dict.fromkeys(_POINTS, points),
        "pose_starts": writer.count("poses") // 12,
        "ray_scans": writer.count("scan_sizes"),
        **dict.fromkeys(("label_tracks", *SHAPE_KINDS.values()), writer.count("track_names")),
    }
    heads = {
        "track_starts": writer.count("scan_sizes"),
        "shard_starts": points,
        "text_starts": writer.count("text_bytes"),
    }
    for name in (*INDEX, *EXTRAS):
        values = part.column(name)
        if name in heads:
            writer.extend(name, values[1:] + heads[name])
        elif name in bases:
            # -1 means none.
            writer.extend(name, np.where(values < 0, values, values + bases[name]))
        else:
            writer.extend(name, values)
