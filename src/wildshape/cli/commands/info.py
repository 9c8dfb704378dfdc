# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape info`: what a store or a folder of tracks holds, in numbers and pictures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from wildshape.cli.options import DEFAULT_FILES, AsJson, Files, Input, Overwrite, option
from wildshape.errors import BadInputError

EXAMPLES = (
    "wildshape info cars.store --out cars.html",
    "wildshape info mytracks --json",
)

OutFile = Annotated[
    Path | None,
    option(
        metavar="FILE", help="page (.html), picture (.png), or a folder for both and the numbers"
    ),
]
Sample = Annotated[int, arg(metavar="N", help="tracks whose points are read; 0 reads all")]


@dataclass(frozen=True)
class Settings:
    """Say what tracks hold: points, ranges, viewing angles, lengths, categories, what was left out.

    A packed store of any size is described from its index; what needs points comes from a sample
    of tracks, drawn by chance and always the same.
    """

    input: Input
    out: OutFile = None
    sample: Sample = 500
    files: Files = DEFAULT_FILES
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Count, print, and draw if asked.

    Raises:
        BadInputError: no tracks there, none that can be read, an output that exists, or a
            sample below 0.
    """
    from wildshape.cli.terminal import TERMINAL, answer, say
    from wildshape.report.statistics.describe import describe_input
    from wildshape.report.statistics.text import table_text

    if settings.sample < 0:
        raise BadInputError(f"--sample {settings.sample}: expected 0 or more.")
    found = describe_input(
        settings.input,
        settings.out,
        settings.sample,
        settings.files.coordinates,
        TERMINAL,
        overwrite=settings.overwrite,
    )
    unusable = found.statistics.unusable
    if unusable:
        first = next(iter(unusable.values())).rstrip(".")
        say(f"{len(unusable)} tracks or scans cannot be read (--json lists them), first: {first}.")
    text = table_text(found.title, found.statistics)
    text += "".join(f"\nsee {path}" for path in found.written)
    answer(text, found.data, as_json=settings.json)
