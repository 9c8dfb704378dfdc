# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape convert`: data sets as they lie on disk become tracks."""

import time
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Layout, Overwrite, Unit
from wildshape.cli.sources import SOURCES, open_source
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.datasets.conversion import PartResult
    from wildshape.datasets.source import Source
    from wildshape.datasets.truth import TruthBuilder

EXAMPLE = "wildshape convert kitti-raw 2011_09_26 cars.store --min-scans 5 --truth mirrored"

Name = Annotated[str, Positional, arg(metavar="SOURCE", help=", ".join(SOURCES))]
Root = Annotated[Path, Positional, arg(metavar="ROOT", help="where it lies")]
Out = Annotated[Path, Positional, arg(metavar="OUT", help="packed store, or folder, to write")]
Count = Annotated[int | None, arg(metavar="N")]
Metres = Annotated[float | None, arg(metavar="M")]
Range = Annotated[tuple[float, float] | None, arg(metavar="LOW HIGH")]
Word = Annotated[str | None, arg(metavar="WORD")]

_OURS = ("source", "root", "out", "layout", "workers", "ray", "overwrite", "json")
_TRUTH = ("truth", "outliers", "outlier_radius", "outlier_neighbours", "ground_strip")


@dataclass(frozen=True)
class Settings:
    """Convert a data set into tracks: the crops of each object over time, with truth if known.

    What is left out is counted by reason. Stopped at any instant, the same command goes on from
    the parts (drives, sequences, logs) that are finished. Options that are not given are the
    reader's own; those that a reader does not have are refused.

    Attributes:
        every: take every k-th frame of an object.
        min_points: a scan with fewer points on the object is left out.
        min_mean_points: an object whose scans have fewer on average is left out.
        min_scans: an object with fewer scans is left out.
        range_m: least and largest distance of a scan from the sensor, metres.
        categories: the data set's own words, with commas: Car,Van.
        motion: objects that moved over the track, that stood, or any.
        margin: labelled boxes are enlarged by this, metres.
        ground: points lower than this above a box's floor are left out, metres.
        keep_ground: leave them in, and those just under the floor.
        truth: accumulate each object's scans, by their true poses, into its shape.
        outliers: which rule removes stray points from that shape.
        outlier_radius: of the rule `radius`, metres.
        outlier_neighbours: how many points the rule `radius` wants within it.
        ground_strip: height above the shape's lowest points that is left out, metres.
        unit: of the coordinates in the files (folder).
        split: of the data set (semantic-kitti, shapenet-views).
        labels: folder of the labels (semantic-kitti).
        gap: frames an object may be out of sight (semantic-kitti, rgbd).
        sweeps: the scans between the labelled ones, too (nuscenes).
        lidar: up, down or both (argoverse2).
        views: of each object (shapenet-views).
        pixels: edge of its images (shapenet-views).
        max_depth: farther pixels are left out, metres (rgbd, bop).
        edge: so many pixels at a mask's border are left out (rgbd, bop).
        workers: processes; by default one a core.
        ray: spread the work over the Ray cluster at this address; `auto` finds the one that this
            machine belongs to, `local` starts one. OUT must lie where all its machines see it.
    """

    source: Name
    root: Root
    out: Out
    layout: Layout = "packed"
    every: Count = None
    min_points: Count = None
    min_mean_points: Count = None
    min_scans: Count = None
    range_m: Range = None
    categories: Annotated[str | None, arg(metavar="A,B")] = None
    motion: Literal["any", "moving", "parked"] | None = None
    margin: Metres = None
    ground: Metres = None
    keep_ground: bool = False
    truth: Literal["none", "partial", "mirrored"] = "none"
    outliers: Literal["statistical", "radius", "none"] = "statistical"
    outlier_radius: Annotated[float, arg(metavar="M")] = 0.15
    outlier_neighbours: Annotated[int, arg(metavar="N")] = 8
    ground_strip: Annotated[float, arg(metavar="M")] = 0.0
    unit: Unit | None = None
    split: Word = None
    labels: Word = None
    gap: Count = None
    sweeps: bool = False
    lidar: Word = None
    views: Count = None
    pixels: Count = None
    max_depth: Metres = None
    edge: Count = None
    workers: Annotated[int | None, arg(metavar="N")] = None
    ray: Annotated[str | None, arg(metavar="ADDRESS")] = None
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Read the source and write its tracks.

    Raises:
        BadInputError: an unknown source, files that are missing or damaged, an existing output.
        MissingExtraError: a library that the source or Ray needs is not installed.
    """
    from wildshape.cli.conversion import Order, convert
    from wildshape.cli.output import keep_apart

    began = time.monotonic()
    _check(settings)
    keep_apart(settings.root, settings.out)
    # Machines of a cluster have working folders of their own.
    root = settings.root if settings.ray is None else settings.root.absolute()
    source = open_source(settings.source, root, _options(settings))
    order = Order(
        name=settings.source,
        source=source,
        out=settings.out,
        layout=settings.layout,
        truth=_truth(settings),
        settings=_identity(settings, source),
        workers=settings.workers,
        ray=settings.ray,
        overwrite=settings.overwrite,
    )
    _tell(convert(order), settings, time.monotonic() - began)


def _options(settings: Settings) -> dict[str, Any]:
    """What the user asked of the reader, by the names of its fields."""
    names = [f.name for f in fields(settings) if f.name not in (*_OURS, *_TRUTH)]
    given = {name: getattr(settings, name) for name in names}
    asked = {name: value for name, value in given.items() if value not in (None, False)}
    if settings.categories is not None:
        asked["categories"] = tuple(w.strip() for w in settings.categories.split(",") if w.strip())
    return asked


def _truth(settings: Settings) -> "TruthBuilder | None":
    from wildshape.datasets.truth import TruthBuilder

    if settings.truth == "none":
        return None
    return TruthBuilder(
        kind=settings.truth,
        outliers=settings.outliers,
        radius=settings.outlier_radius,
        neighbours=settings.outlier_neighbours,
        strip=settings.ground_strip,
    )


def _identity(settings: Settings, source: "Source") -> dict[str, Any]:
    """The reader with all its options, those included that the user did not give."""
    names = [f.name for f in fields(cast("Any", source)) if f.init and f.name != "root"]
    options = {name: getattr(source, name) for name in names}
    values = {n: asdict(cast("Any", v)) if is_dataclass(v) else v for n, v in options.items()}
    return {"source": settings.source, "root": str(settings.root.resolve()), **values}


def _check(settings: Settings) -> None:
    least = {"every": 1, "workers": 1, "outlier_neighbours": 1}
    least |= dict.fromkeys(("min_points", "min_mean_points", "min_scans", "ground_strip"), 0)
    for name, bound in least.items():
        value = getattr(settings, name)
        if value is not None and value < bound:
            raise BadInputError(f"--{name.replace('_', '-')} {value}: expected {bound} or more.")
    if settings.range_m is not None and not 0 <= settings.range_m[0] < settings.range_m[1]:
        low, high = settings.range_m
        raise BadInputError(f"--range-m {low:g} {high:g}: expected two distances, nearer first.")


def _tell(results: "list[PartResult]", settings: Settings, seconds: float) -> None:
    """The figures on stdout, and what was left out as a table on stderr."""
    from wildshape.cli.converted import left_out
    from wildshape.cli.terminal import answer, duration, say

    counts = {key: sum(getattr(r, key) for r in results) for key in ("tracks", "scans", "points")}
    reasons = left_out(results)
    if reasons:
        width = max(map(len, reasons))
        say("\n".join(("left out:", *(f"  {r:{width}}  {n:9,}" for r, n in reasons.items()))))
    text = (
        f"converted {counts['tracks']} tracks, {counts['scans']} scans, {counts['points']} points"
        f" in {duration(seconds)}; see {settings.out}"
    )
    parts = [{key: value for key, value in asdict(r).items() if key != "names"} for r in results]
    data = {"out": str(settings.out), **counts, "left_out": reasons, "parts": parts}
    answer(text, {**data, "seconds": round(seconds, 3)}, as_json=settings.json)
