# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Stores whose files were changed: as versions before CRCs wrote them, or with checksums again."""

import json
from pathlib import Path
from typing import Any

from safetensors.numpy import load_file, save_file

from wildshape.io.store.index import file_record
from wildshape.io.store.layout import CRCS, INDEX_JSON, INDEX_TENSORS
from wildshape.io.store.manifest import manifest_of


def make_older(path: Path) -> None:
    """Take away from a store what older versions did not write."""
    index = load_file(path / INDEX_TENSORS)
    for name in CRCS:
        del index[name]
    save_file(index, path / INDEX_TENSORS)
    older = reseal(path)
    del older["checksum"]
    (path / INDEX_JSON).write_text(json.dumps(older, indent=2))


def reseal(path: Path) -> dict[str, Any]:
    """Write the checksums of a store's files as they are now."""
    said = json.loads((path / INDEX_JSON).read_text("utf-8"))
    index, *shards = [file_record(path / f["file"]) for f in (said["index"], *said["shards"])]
    counts = {name: said[name] for name in ("tracks", "scans", "points")}
    manifest = manifest_of(index, shards, counts, said["provenance"])
    (path / INDEX_JSON).write_text(json.dumps(manifest))
    return manifest
