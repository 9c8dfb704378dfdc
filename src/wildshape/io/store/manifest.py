# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`index.json` of a packed store, and what tells that it was damaged."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.store.layout import (
    CURE,
    FORMAT,
    INDEX_JSON,
    INDEX_TENSORS,
    SHARD_NAME,
    VERSION,
    WRITING_JSON,
    FileRecord,
)

_KEYS = {"fingerprint", "tracks", "scans", "points", "index", "shards", "provenance"}
_CHECKSUM = "checksum"


def manifest_of(
    index: FileRecord, shards: list[FileRecord], counts: dict[str, int], provenance: dict[str, Any]
) -> dict[str, Any]:
    """What `index.json` says."""
    return sealed(
        {
            "format": FORMAT,
            "version": VERSION,
            "fingerprint": _fingerprint([index, *shards]),
            **counts,
            "index": asdict(index),
            "shards": [asdict(shard) for shard in shards],
            "provenance": provenance,
        }
    )


def read_manifest(path: Path) -> dict[str, Any]:
    """`index.json` of a finished store of this version.

    Raises:
        BadInputError: there is no store, it was never finished, another version wrote it, or it
            is damaged.
    """
    manifest = path / INDEX_JSON
    if not manifest.exists():
        if (path / WRITING_JSON).exists():
            raise BadInputError(
                f"{path}: a half-written packed store (its writer was stopped or still runs); "
                "repeat the command that was writing it, or write it again with --overwrite."
            )
        raise BadInputError(f"{path}: no packed store ({INDEX_JSON} is missing); check the path.")
    with reading(manifest, "the index of a packed store"):
        data = json.loads(manifest.read_text("utf-8"))
        found = (data.get("format"), data.get("version"))
        if found != (FORMAT, VERSION):
            raise BadInputError(
                f"{manifest}: expected {FORMAT} version {VERSION}, found {found[0]} version "
                f"{found[1]}; convert the data again with this version of Wildshape."
            )
        missing = _KEYS - data.keys()
        if missing:
            raise BadInputError(f"{manifest}: lacks {', '.join(sorted(missing))}; {CURE}.")
        check_seal(manifest, data)
        if _fingerprint(files_of(data)) != data["fingerprint"]:
            raise ValueError("its checksums do not fit its fingerprint")
        return data


def files_of(manifest: dict[str, Any]) -> list[FileRecord]:
    """The index and the shards, in order.

    Raises:
        ValueError: they are not named as those of a store.
        TypeError: one is not described as a file is.
    """
    files = [FileRecord(**raw) for raw in (manifest["index"], *manifest["shards"])]
    names = [INDEX_TENSORS, *(SHARD_NAME.format(i) for i in range(len(files) - 1))]
    if [record.file for record in files] != names:
        raise ValueError("its files have other names than those of a store")
    return files


def _fingerprint(files: list[FileRecord]) -> str:
    return hashlib.sha256("".join(f.sha256 for f in files).encode()).hexdigest()[:16]


def sealed(data: dict[str, Any]) -> dict[str, Any]:
    """JSON values with a checksum of their own beside them."""
    return {**data, _CHECKSUM: _digest(data)}


def is_sealed(data: dict[str, Any]) -> bool:
    """Whether JSON values have a checksum beside them; older versions wrote none."""
    return _CHECKSUM in data


def check_seal(path: Path, data: dict[str, Any]) -> None:
    """Compare JSON values with their checksum, if they have one.

    Raises:
        BadInputError: they are not what was written.
    """
    if is_sealed(data) and _digest(data) != data[_CHECKSUM]:
        raise BadInputError(f"{path}: damaged, its checksum is wrong; {CURE}.")


def _digest(data: dict[str, Any]) -> str:
    """Of the values as they come back from the disk, in any order.

    Raises:
        ValueError: a number is NaN or infinite.
    """
    plain = {k: v for k, v in data.items() if k != _CHECKSUM}
    kept = json.loads(json.dumps(plain, allow_nan=False))
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()
