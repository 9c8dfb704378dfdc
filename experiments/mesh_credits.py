# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which meshes shipped weights may be made from, and whom they are by.

    python -m experiments.mesh_credits CAD > NOTICE

No GPL, no ShareAlike. What asks for its author to be named (CC-BY) is named, each model.
"""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import tyro

from wildshape.cli.main import in_a_sentence
from wildshape.errors import BadInputError

TIERS = ("A", "A?")
"""CC0, CC-BY, BSD, Apache, MIT; or likely so."""

Row = dict[str, str]


class Credit(NamedTuple):
    """Who made a collection, and where it is."""

    author: str
    place: str


CREDITS = {
    "gazebo_models": Credit(
        "Nathan Koenig and contributors, Open Source Robotics Foundation",
        "https://github.com/osrf/gazebo_models",
    ),
    "ikea_manuals": Credit(
        "Ruocheng Wang, Yunzhi Zhang, Jiayuan Mao, Ran Zhang, Chin-Yi Cheng, Jiajun Wu"
        " (IKEA-Manual, 2022), as published with IKEA Video Manuals (Yunong Liu and others, 2024)",
        "https://cs.stanford.edu/~rcwang/projects/ikea_manual",
    ),
}


def rows_of(cad: Path, split: str) -> list[Row]:
    """The manifest's rows of a split; of `train` those that weights may be made from.

    Args:
        cad: folder with a manifest.
        split: `train` or `test`.

    Raises:
        BadInputError: there is no manifest.
    """
    path = cad / "manifest.csv"
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; give the folder of the CAD meshes.")
    with path.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["split"] == split]
    return [row for row in rows if row["tier"] in TIERS or split != "train"]


def notice(cad: Path) -> str:
    """The NOTICE of weights made from the meshes: by source, every CC-BY model by name.

    Args:
        cad: folder with a manifest.

    Raises:
        BadInputError: a CC-BY model whose author is not known.
    """
    rows = rows_of(cad, "train")
    return (
        "The weights were trained on simulated scans of procedural shapes and of these models.\n"
        "The models were scaled, stretched and bent, and seen by simulated sensors; none of them"
        " is in the weights' files.\n\nModels whose licence asks for credit\n\n"
        + "".join(sorted(f"- {_credited(row)}\n" for row in rows if _asks(row)))
        + "\nModels in the public domain or under permissive licences\n\n"
        + "".join(_counted(row for row in rows if not _asks(row)))
    )


def _asks(row: Row) -> bool:
    return "CC-BY" in row["licence"].upper()


def _credited(row: Row) -> str:
    credit = CREDITS.get(row["source"])
    if credit is None:
        raise BadInputError(
            f"{row['file']}: {row['licence']}, but the author of {row['source']} is not known;"
            " add them to CREDITS of experiments/mesh_credits.py."
        )
    licence = row["licence"].split()[0]
    return f'{row["category"]} "{row["name"]}", {licence}, by {credit.author}, {credit.place}'


def _counted(rows: Iterable[Row]) -> list[str]:
    by_source: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        by_source.setdefault((row["source"], row["licence"]), []).append(row["name"])
    return [
        f"- {source}, {licence}: {', '.join(sorted(names))}\n"
        for (source, licence), names in sorted(by_source.items())
    ]


def _main(cad: tyro.conf.Positional[Path]) -> None:
    print(notice(cad), end="")


if __name__ == "__main__":
    with in_a_sentence():
        tyro.cli(_main)
