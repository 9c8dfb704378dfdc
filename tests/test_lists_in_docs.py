# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a page lists what there is, nothing is missing."""

import re
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

import wildshape
from wildshape.drives.config import DriveConfig
from wildshape.inference.folders.complete_folder import objects_of
from wildshape.io.scans.point_times import TIME_FIELDS
from wildshape.records import Track

DOCS = Path(__file__).parent.parent / "docs"


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_api_shows_what_the_page_of_drives_calls_and_sets():
    called = re.findall(r"^from (wildshape[\w.]+) import (.+)$", page("drive.md"), re.MULTILINE)
    names = {f"{module}.{name}" for module, row in called for name in row.split(", ")}
    records = [type(value) for value in vars(DriveConfig()).values()]
    names |= {f"{one.__module__}.{one.__name__}" for one in records if one is not bool}
    assert len(names) > 15
    assert names <= shown_by_the_api()


def shown_by_the_api() -> set[str]:
    """The names of each module on its pages: the members listed, or else all."""
    text = "\n".join(path.read_text("utf-8") for path in (DOCS / "api").glob("*.md"))
    entries = re.findall(r"^::: (\S+)$(?:\n +options:\n +members: \[(.*)\])?", text, re.MULTILINE)
    return {
        f"{module}.{name}"
        for module, members in entries
        for name in (members.split(", ") if members else dir(resolve_name(module)))
    }


def test_all_that_objects_json_holds_is_named():
    model = wildshape.load()
    scan = np.load(DOCS.parent / "examples" / "scan.npy")
    done, track = [model.complete(scan)], Track("a", (scan,), ("0",))
    said = objects_of(track, done, model, DOCS, together=False)
    unnamed = {name for name in (*said, *said["scans"][0]) if f'"{name}"' not in page("formats.md")}
    assert not unnamed


def test_the_fields_of_times_are_named():
    assert not [name for name in TIME_FIELDS if f"`{name}`" not in page("drive.md")]
