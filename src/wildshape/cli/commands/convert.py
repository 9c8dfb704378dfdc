# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape convert`: data sets as they lie on disk become tracks."""

import math
import time
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from wildshape.cli.options import (
    DEFAULT_WORK,
    AsJson,
    Layout,
    Origin,
    Overwrite,
    Unit,
    Work,
    listed,
    option,
)
from wildshape.datasets.sources import SOURCES
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.datasets.convert import Converted
    from wildshape.datasets.tracks.truth import TruthBuilder

EXAMPLES = (
    "wildshape convert semantic-kitti dataset cars.store --workers 4",
    "wildshape convert kitti-raw 2011_09_26 cars.store --min-scans 5 --truth mirrored",
    "wildshape convert nuscenes data/nuscenes cars.store --categories car,truck --range-m 2,40",
    "wildshape convert folder myscans mytracks --layout folders --unit mm",
)

Name = Annotated[str, Positional, arg(metavar="SOURCE", help=", ".join(SOURCES))]
Root = Annotated[Path, Positional, arg(metavar="ROOT", help="where it lies")]
Out = Annotated[Path, Positional, arg(metavar="OUT", help="packed store, or folder, to write")]
Count = Annotated[int | None, option(metavar="N")]
Metres = Annotated[float | None, option(metavar="M")]
Range = Annotated[tuple[float, float] | None, listed("LOW,HIGH", float, count=2, words=1), option()]
Words = Annotated[tuple[str, ...] | None, listed("A,B", words=1), option()]
Word = Annotated[str | None, option(metavar="WORD")]

_OURS = ("source", "root", "out", "layout", "work", "overwrite", "json")
_DOUBTS = 4
_TRUTH = ("truth", "outliers", "outlier_radius", "outlier_neighbours", "ground_strip")


@dataclass(frozen=True)
class Settings:
    """Convert a data set into tracks: the crops of each object over time, with truth if known.

    What is left out is counted by reason. Stopped at any instant, the same command goes on from
    the parts (drives, sequences, logs) that are finished. Options that are not given are the
    reader's own; those that a reader does not have are refused.

    Attributes:
        every: take every N-th frame of an object.
        min_points: a scan with fewer points on the object is left out; by default 100, of folders
            and packed stores 16.
        min_mean_points: an object whose scans have fewer on average is left out.
        min_scans: an object with fewer scans is left out.
        range_m: least and largest distance of a scan from the sensor, metres.
        largest_m: a scan with a longer diagonal is left out, metres; by default 20.1 of folders.
        categories: the data set's own words: Car,Van.
        motion: objects that moved over the track, that stood, or any.
        margin: labelled boxes are enlarged by this, metres; by default 0.15.
        ground: points lower than this above a box's floor are left out, metres; by default 0.2.
        keep_ground: leave them in, and those just under the floor.
        truth: accumulate each object's scans, by their true poses, into its shape.
        outliers: which rule removes stray points from that shape.
        outlier_radius: of the rule `radius`, metres.
        outlier_neighbours: how many points the rule `radius` wants within it.
        ground_strip: height above the shape's lowest points that is left out, metres.
        unit: of the coordinates in the files (folder).
        origin: the sensor's position in the files, of scans that were moved into a map (folder).
        split: train, test or all (semantic-kitti), also val (shapenet-views); by default all.
        labels: folder of the labels (semantic-kitti).
        gap: frames that an object may be out of sight and stay one track; by default 100 (rgbd),
            any number (semantic-kitti).
        sweeps: the scans between the labelled ones, too (nuscenes).
        lidar: up, down or both, the default (argoverse2); a channel such as LIDAR_RIGHT (nuscenes).
        views: of each object, by default 5 (shapenet-views).
        pixels: edge of its images, by default 128 (shapenet-views).
        max_depth: farther pixels are left out, metres (rgbd, bop).
        edge: so many pixels at a mask's border are left out, by default 1 (rgbd, bop).
        rays: also keep the rays around each scan that did not hit its object (docs/formats.md): up
            to six times the space of the scans.
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
    largest_m: Metres = None
    categories: Words = None
    motion: Annotated[
        Literal["any", "moving", "parked"] | None, option(metavar="{any,moving,parked}")
    ] = None
    margin: Metres = None
    ground: Metres = None
    keep_ground: bool = False
    truth: Literal["none", "partial", "mirrored"] = "none"
    outliers: Literal["statistical", "radius", "none"] = "statistical"
    outlier_radius: Annotated[float, arg(metavar="M")] = 0.15
    outlier_neighbours: Annotated[int, arg(metavar="N")] = 8
    ground_strip: Annotated[float, arg(metavar="M")] = 0.0
    unit: Annotated[Unit | None, option(metavar="{m,cm,mm}")] = None
    origin: Annotated[Origin | None, option(metavar="X,Y,Z")] = None
    split: Word = None
    labels: Word = None
    gap: Count = None
    sweeps: bool = False
    lidar: Word = None
    views: Count = None
    pixels: Count = None
    max_depth: Metres = None
    edge: Count = None
    rays: bool = False
    work: Work = DEFAULT_WORK
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Read the source and write its tracks.

    Raises:
        BadInputError: an unknown source, files that are missing or damaged, an existing output.
        MissingExtraError: a library that the source or Ray needs is not installed.
    """
    from wildshape.cli.terminal import TERMINAL
    from wildshape.datasets.convert import ConversionOptions, convert
    from wildshape.datasets.sources import open_source
    from wildshape.io.output import keep_apart

    began = time.monotonic()
    _check(settings)
    keep_apart(settings.out, settings.root)
    # Machines of a cluster have working folders of their own.
    work = settings.work
    root = settings.root if work.ray is None else settings.root.absolute()
    source = open_source(settings.source, root, _options(settings))
    options = ConversionOptions(
        settings.layout, _truth(settings), work.workers, work.ray, settings.overwrite
    )
    found = convert(source, settings.out, options, TERMINAL, name=settings.source)
    _tell(found, settings, time.monotonic() - began)


def _options(settings: Settings) -> dict[str, Any]:
    """What the user asked of the reader, by the names of its fields."""
    names = [f.name for f in fields(settings) if f.name not in (*_OURS, *_TRUTH)]
    asked = {name: getattr(settings, name) for name in names}
    if settings.categories == ():
        raise BadInputError("--categories names no category; leave it out for the usual ones.")
    # By identity: 0 == False, and an explicit zero is a wish.
    return {name: v for name, v in asked.items() if v is not None and v is not False}


def _truth(settings: Settings) -> "TruthBuilder | None":
    from wildshape.datasets.tracks.truth import TruthBuilder

    if settings.truth == "none":
        return None
    return TruthBuilder(
        kind=settings.truth,
        outliers=settings.outliers,
        radius=settings.outlier_radius,
        neighbours=settings.outlier_neighbours,
        strip=settings.ground_strip,
    )


def _check(settings: Settings) -> None:
    least = dict.fromkeys(("every", "outlier_neighbours", "views"), 1)
    least |= dict.fromkeys(("min_points", "min_mean_points", "min_scans", "ground_strip"), 0)
    least |= dict.fromkeys(("gap", "pixels", "edge", "max_depth", "largest_m"), 0)
    for name, bound in least.items():
        value = getattr(settings, name)
        if value is not None and not value >= bound:
            raise BadInputError(f"--{name.replace('_', '-')} {value}: expected {bound} or more.")
    _check_truth(settings)
    if settings.keep_ground and settings.ground is not None:
        raise BadInputError("--ground has no effect beside --keep-ground; pass one of them.")
    for name in ("margin", "ground"):
        if not math.isfinite(getattr(settings, name) or 0.0):
            raise BadInputError(f"--{name} {getattr(settings, name)}: expected a number of metres.")
    if settings.range_m is not None and not 0 <= settings.range_m[0] < settings.range_m[1]:
        low, high = settings.range_m
        raise BadInputError(f"--range-m {low:g} {high:g}: expected two distances, nearer first.")


def _check_truth(settings: Settings) -> None:
    given = [name for name in _TRUTH[1:] if getattr(settings, name) != getattr(Settings, name)]
    if settings.truth == "none":
        acting, needs = (), "--truth"
    elif settings.outliers == "radius":
        acting, needs = _TRUTH, ""
    else:
        acting, needs = ("outliers", "ground_strip"), "--outliers radius"
    for name in given:
        if name not in acting:
            raise BadInputError(
                f"--{name.replace('_', '-')} has no effect without {needs}; pass that, too, or"
                " leave it out."
            )
    if not 0 < settings.outlier_radius < math.inf:
        raise BadInputError(f"--outlier-radius {settings.outlier_radius}: expected metres above 0.")


def _without_tracks(settings: Settings, found: set[str]) -> list[str]:
    """Categories asked for that no track has; those of nuScenes are parts of dotted names."""
    dotted = [f".vehicle.{name.lower()}." for name in found]
    asked = [word for word in settings.categories or () if not word.isdigit()]  # synsets
    return [word for word in asked if not any(f".{word.lower()}." in name for name in dotted)]


def _tell(found: "Converted", settings: Settings, seconds: float) -> None:
    """The figures on stdout, and what was left out as a table on stderr."""
    from wildshape.cli.terminal import answer, say
    from wildshape.datasets.destinations import left_out
    from wildshape.io.progress import counted, duration

    results = found.parts
    counts = {key: sum(getattr(r, key) for r in results) for key in ("tracks", "scans", "points")}
    reasons = left_out(results)
    if reasons:
        say("\n".join(("left out:", *(f"{n:9,}  {r}" for r, n in reasons.items()))))
    damaged = [result.damage for result in results if result.damage]
    if damaged:
        say(f"{len(damaged)} of {len(results)} parts are damaged, for example {damaged[0]}")
    for word in _without_tracks(settings, {name for r in results for name in r.categories}):
        say(f"no track is of the category '{word}'; is it one of the data set's own words?")
    doubts = [told for result in results for told in result.doubts]
    for told in doubts[:_DOUBTS]:
        say(told)
    if len(doubts) > _DOUBTS:
        say(f"and {counted(len(doubts) - _DOUBTS, 'more doubt')} of this kind")
    written = ", ".join(counted(n, key.removesuffix("s")) for key, n in counts.items())
    took = f"in {duration(seconds)} with {counted(found.workers, 'worker')}"
    text = f"converted {written} {took}; see {settings.out}"
    parts = [{key: value for key, value in asdict(r).items() if key != "names"} for r in results]
    data = {"out": str(settings.out), **counts, "left_out": reasons, "parts": parts}
    data |= {"workers": found.workers, "seconds": round(seconds, 3)}
    answer(text, data, as_json=settings.json)
