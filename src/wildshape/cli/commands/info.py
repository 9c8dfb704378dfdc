# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape info`: what a store or a folder of tracks holds, in numbers and pictures."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from wildshape.cli.options import AT_ORIGIN, AsJson, Input, Origin, Overwrite, Unit, option

if TYPE_CHECKING:
    from wildshape.io.inputs import TrackSource
    from wildshape.records import Track
    from wildshape.report.statistics.statistics import Quantity, Statistics

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
_BINS, _THUMBNAILS = 24, 12
_SHARES = {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}


@dataclass(frozen=True)
class Settings:
    """Say what tracks hold: points, ranges, viewing angles, lengths, categories, what was left out.

    A packed store of any size is described from its index; what needs points comes from a sample
    of tracks, drawn by chance and always the same.
    """

    input: Input
    out: OutFile = None
    sample: Sample = 500
    unit: Unit = "m"
    origin: Origin = AT_ORIGIN
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Count, print, and draw if asked.

    Raises:
        BadInputError: no tracks there, none that can be read, or an output that exists.
    """
    from wildshape.cli.info.table import table_text
    from wildshape.cli.terminal import answer, say
    from wildshape.io.inputs import open_tracks
    from wildshape.io.scans.points import Coordinates

    files = _files(settings)
    source = open_tracks(settings.input, Coordinates(settings.unit, settings.origin))
    found = _count(settings, source)
    written = _write(settings, files, found, source)
    if found.unusable:
        say(f"{len(found.unusable)} tracks or scans cannot be read; --json lists them")
    text = table_text(_title(settings), found)
    text += "".join(f"\nsee {path}" for path in written)
    data = {**as_data(found), "written": [str(path) for path in written]}
    answer(text, data, as_json=settings.json)


def as_data(found: "Statistics") -> dict[str, Any]:
    """The numbers as JSON values."""
    from dataclasses import asdict, replace

    data = asdict(replace(found, quantities=()))
    return {**data, "quantities": {q.name: _quantity(q) for q in found.quantities}}


def _quantity(quantity: "Quantity") -> dict[str, Any]:
    tally = quantity.tally
    edges, shares = tally.bars(_BINS)
    return {
        "title": quantity.title,
        "unit": quantity.unit,
        "from": quantity.basis,
        "count": tally.count,
        "least": tally.least,
        "most": tally.most,
        "mean": tally.mean,
        **{name: tally.quantile(share) for name, share in _SHARES.items()},
        "histogram": {"edges": edges.tolist(), "shares": shares.tolist()},
    }


def _count(settings: Settings, source: "TrackSource") -> "Statistics":
    from dataclasses import replace

    from wildshape.cli.terminal import progress
    from wildshape.io.store.origin import origin_of
    from wildshape.io.store.store import is_store, open_store
    from wildshape.report.statistics.statistics import (
        sample_of,
        statistics_of_store,
        statistics_of_tracks,
    )

    chosen = sample_of(len(source), settings.sample)
    with progress("reading tracks", len(chosen)) as bar:
        if is_store(settings.input):
            found = statistics_of_store(open_store(settings.input), chosen, bar.at)
        else:
            found = statistics_of_tracks(source, chosen, bar.at)
    made = origin_of(settings.input)
    return replace(found, left_out=made.left_out, provenance=made.provenance)


def _files(settings: Settings) -> list[Path]:
    """What is to be written, refused early where it exists.

    Raises:
        BadInputError: it exists, or has another suffix.
    """
    from wildshape.cli.output import refuse_file
    from wildshape.errors import BadInputError

    out = settings.out
    if out is None:
        return []
    if out.suffix and out.suffix not in (".html", ".png"):
        raise BadInputError(f"{out}: give a page (.html), a picture (.png) or a folder.")
    names = ("info.html", "info.png", "info.json")
    files = [out] if out.suffix else [out / name for name in names]
    for file in files:
        refuse_file(file, overwrite=settings.overwrite)
    return files


def _write(
    settings: Settings, files: list[Path], found: "Statistics", source: "TrackSource"
) -> list[Path]:
    from wildshape.io.atomic import write_json
    from wildshape.report.statistics.sheet import write_sheet, write_statistics_page

    tracks = _shown(source) if any(file.suffix != ".json" for file in files) else []
    for file in files:
        if file.suffix == ".html":
            write_statistics_page(_title(settings), found, tracks, file)
        elif file.suffix == ".png":
            write_sheet(_title(settings), found, tracks, file)
        else:
            write_json(file, as_data(found))
    return files


def _shown(source: "TrackSource") -> "list[Track]":
    """A few tracks from the first to the last, of those that can be read."""
    from wildshape.errors import BadInputError
    from wildshape.report.statistics.thumbnails import spread

    shown = []
    for number in spread(len(source), _THUMBNAILS):
        try:
            shown.append(source[number])
        except BadInputError:  # said already, when it was counted
            continue
    return shown


def _title(settings: Settings) -> str:
    from wildshape.records import as_text

    return as_text(settings.input.resolve().name)
