# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Stores as versions before CRCs wrote them."""

import json
from pathlib import Path

from safetensors.numpy import load_file, save_file

from wildshape.io.store.index import file_record
from wildshape.io.store.layout import CRCS, INDEX_JSON, INDEX_TENSORS, FileRecord
from wildshape.io.store.manifest import manifest_of


def make_older(path: Path) -> None:
    """Take away from a store what older versions did not write."""
    index = load_file(path / INDEX_TENSORS)
    for name in CRCS:
        del index[name]
    save_file(index, path / INDEX_TENSORS)
    said = json.loads((path / INDEX_JSON).read_text())
    counts = {key: said[key] for key in ("tracks", "scans", "points")}
    record = file_record(path / INDEX_TENSORS)
    older = manifest_of(record, shards_of(path), counts, said["provenance"])
    del older["checksum"]
    (path / INDEX_JSON).write_text(json.dumps(older, indent=2))


def shards_of(path: Path) -> list[FileRecord]:
    """The files of points that a store lists."""
    return [FileRecord(**shard) for shard in json.loads((path / INDEX_JSON).read_text())["shards"]]
