# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How tracks were made, as kept with them: in a store's index, or in a folder's wildshape.json."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wildshape.io.store.layout import INDEX_JSON, WRITING_JSON

_RECORDS = (INDEX_JSON, "wildshape.json")


@dataclass(frozen=True)
class StoreOrigin:
    """How some tracks came about.

    Attributes:
        provenance: JSON values, without the list of parts; empty if nobody kept them.
        left_out: how many scans and objects were left out then, by reason.
    """

    provenance: dict[str, Any] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)


def origin_of(path: Path) -> StoreOrigin:
    """What is kept at a packed store or DATASET folder; a damaged record counts as none."""
    for name in _RECORDS:
        record = _read(path / name)
        if record:
            return _parse(record)
    return StoreOrigin()


def unfinished_provenance(path: Path) -> dict[str, Any]:
    """That of a packed store which is being written; a damaged record counts as none."""
    return _provenance(_read(path / WRITING_JSON))


def is_begun_by(path: Path, made: dict[str, Any]) -> bool:
    """Whether a run of the command and settings in a provenance was stopped while writing there."""
    found = unfinished_provenance(path)
    return all(found.get(key) == made[key] for key in ("made_by", "settings"))


def _provenance(record: dict[str, Any]) -> dict[str, Any]:
    found = record.get("provenance")
    return found if isinstance(found, dict) else {}


def _parse(record: dict[str, Any]) -> StoreOrigin:
    provenance = dict(_provenance(record))
    provenance.pop("parts", None)  # of a large data set there are thousands
    raw = provenance.pop("left_out", None) or record.get("left_out")
    left_out = raw if isinstance(raw, dict) else {}
    counted = {str(k): v for k, v in left_out.items() if isinstance(v, int)}
    if "settings" not in provenance and "settings" in record:
        provenance["settings"] = record["settings"]
    return StoreOrigin(provenance, dict(sorted(counted.items(), key=lambda pair: -pair[1])))


def _read(path: Path) -> dict[str, Any]:
    try:
        record = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}
