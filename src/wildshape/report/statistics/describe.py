# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What an input holds, counted and drawn: a page, a picture, the numbers as JSON."""

from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.io.atomic import write_json
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.output import begin_file
from wildshape.io.progress import SILENT, Progress
from wildshape.io.scans.points import SENSOR_METRES, Coordinates
from wildshape.io.store.origin import origin_of
from wildshape.io.store.store import is_store, open_store
from wildshape.records import Track, as_text
from wildshape.report.statistics.sheet import write_sheet, write_statistics_page
from wildshape.report.statistics.statistics import (
    Quantity,
    Statistics,
    sample_of,
    statistics_of_store,
    statistics_of_tracks,
)
from wildshape.report.statistics.thumbnails import spread

_BINS, _THUMBNAILS = 24, 12
_SHARES = {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}


@dataclass(frozen=True)
class Description:
    """What an input holds, its name, and the files that were written."""

    title: str
    statistics: Statistics
    written: list[Path]

    @property
    def data(self) -> dict[str, Any]:
        """The same as JSON values."""
        return {**as_data(self.statistics), "written": [str(path) for path in self.written]}


def describe_input(
    path: Path,
    out: Path | None = None,
    sample: int = 500,
    coordinates: Coordinates = SENSOR_METRES,
    progress: Progress = SILENT,
    *,
    overwrite: bool = False,
) -> Description:
    """Count what tracks hold, and draw it if asked.

    Args:
        path: what `open_tracks` takes; a packed store of any size is described from its index.
        out: page (.html), picture (.png), or a folder for both and the numbers; None: none.
        sample: tracks whose points are read; 0 reads all.
        coordinates: of the files.
        progress: is told what goes on.
        overwrite: replace the files.

    Raises:
        BadInputError: no tracks there, none that can be read, or an output that exists.
    """
    files = _files(out, overwrite=overwrite)
    source = open_tracks(path, coordinates)
    found, title = _count(path, source, sample, progress), as_text(path.resolve().name)
    tracks = _shown(source) if any(file.suffix != ".json" for file in files) else []
    for file in files:
        if file.suffix == ".html":
            write_statistics_page(title, found, tracks, file)
        elif file.suffix == ".png":
            write_sheet(title, found, tracks, file)
        else:
            write_json(file, as_data(found))
    return Description(title, found, files)


def as_data(found: Statistics) -> dict[str, Any]:
    """The numbers as JSON values."""
    data = asdict(replace(found, quantities=()))
    return {**data, "quantities": {q.name: _quantity(q) for q in found.quantities}}


def _quantity(quantity: Quantity) -> dict[str, Any]:
    tally = quantity.tally
    edges, shares = tally.bars(_BINS)
    return {
        "title": quantity.title,
        "unit": quantity.unit,
        "from": quantity.basis,
        "count": tally.count,
        "least": tally.least,
        "most": tally.most,
        "mean": tally.mean if isfinite(tally.mean) else None,
        **{name: tally.quantile(share) for name, share in _SHARES.items()},
        "histogram": {"edges": edges.tolist(), "shares": shares.tolist()},
    }


def _count(path: Path, source: TrackSource, sample: int, progress: Progress) -> Statistics:
    chosen = sample_of(len(source), sample)
    with progress.bar("reading tracks", len(chosen)) as bar:
        if is_store(path):
            found = statistics_of_store(open_store(path), chosen, bar.at)
        else:
            found = statistics_of_tracks(source, chosen, bar.at)
    origin = origin_of(path)
    return replace(found, left_out=origin.left_out, provenance=origin.provenance)


def _files(out: Path | None, *, overwrite: bool) -> list[Path]:
    """What is to be written, refused early where it exists.

    Raises:
        BadInputError: it exists, or has another suffix.
    """
    if out is None:
        return []
    if out.suffix and out.suffix not in (".html", ".png"):
        raise BadInputError(f"{out}: give a page (.html), a picture (.png) or a folder.")
    names = ("info.html", "info.png", "info.json")
    files = [out] if out.suffix else [out / name for name in names]
    for file in files:
        begin_file(file, overwrite=overwrite)
    return files


def _shown(source: TrackSource) -> list[Track]:
    """A few tracks from the first to the last, of those that can be read."""
    shown = []
    for number in spread(len(source), _THUMBNAILS):
        try:
            shown.append(source[number])
        except BadInputError:  # said already, when it was counted
            continue
    return shown
