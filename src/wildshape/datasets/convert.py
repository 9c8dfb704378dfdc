# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A whole conversion: its parts shared out over cores or a cluster, then put together."""

import hashlib
import json
from contextlib import nullcontext
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, cast

from wildshape.arguments import as_path, check_fields, expect
from wildshape.datasets.destinations import PackedStore, TrackFolders, left_out
from wildshape.datasets.tracks.conversion import Conversion, Part, PartResult
from wildshape.datasets.tracks.source import Source
from wildshape.datasets.tracks.truth import TruthBuilder
from wildshape.errors import BadInputError, LostWorkersError, MissingExtraError
from wildshape.io.fingerprint import fingerprint_of
from wildshape.io.progress import SILENT, Progress, counted
from wildshape.io.store.layout import PARTS
from wildshape.io.write_tracks import Layout
from wildshape.parallel.team import ALONE, team


@dataclass(frozen=True)
class ConversionOptions:
    """How a data set is converted.

    Attributes:
        layout: as one store or as folders.
        truth: what makes shapes from poses, if anything.
        workers: processes; None: one a core.
        ray: address of a Ray cluster instead, if any.
        overwrite: replace an earlier output.
    """

    layout: Layout = "packed"
    truth: TruthBuilder | None = None
    workers: int | None = None
    ray: str | None = None
    overwrite: bool = False

    def __post_init__(self) -> None:
        check_fields(self)


_DEFAULT = ConversionOptions()
_NAMED = 3  # reasons, where nothing is left


@dataclass(frozen=True)
class Converted:
    """What became of a data set.

    Attributes:
        parts: what became of each, in order.
        workers: how many did the work.
    """

    parts: list[PartResult]
    workers: int = 1


def convert(
    source: Source,
    out: Path | str,
    options: ConversionOptions = _DEFAULT,
    progress: Progress = SILENT,
    *,
    name: str = "",
) -> Converted:
    """Convert all parts, or those that an earlier run did not finish.

    The output depends on the data set and the options alone, not on who worked on what when.

    Raises:
        BadInputError: the data set or the output cannot be used, or no track came.
        MissingExtraError: Ray is not installed.
    """
    expect(source, Source, "source", "open_source makes one of a folder")
    expect(options, ConversionOptions, "options")
    out, name = as_path(out, "out"), name or type(source).__name__
    parts = [Part(i, part) for i, part in enumerate(source.parts())]
    identity = _identity(name, source, options, parts)
    settings = json.loads(json.dumps(identity, default=str), parse_constant=str)
    kind = PackedStore if options.layout == "packed" else TrackFolders
    destination = kind(out, settings, options.overwrite, progress)
    earlier = destination.begin()
    if earlier is not None:
        return Converted(earlier)
    task = Conversion(source, (out / PARTS).absolute(), options.layout, options.truth)
    try:
        found = _all_parts(task, parts, options, f"converting {name}", progress)
        if not any(result.tracks for result in found.parts):
            raise BadInputError(_nothing(settings["root"], found.parts))
        destination.finish([(task.place(part), result) for part, result in zip(parts, found.parts)])
    except (BadInputError, MissingExtraError) as error:
        made = any(done.tracks for part in parts if (done := task.finished(part)))
        if not made or (destination.replaces and not isinstance(error, LostWorkersError)):
            destination.abandon()
        raise
    return found


def _identity(
    name: str, source: Source, options: ConversionOptions, parts: list[Part]
) -> dict[str, Any]:
    """All that decides the output: the reader with all its options, the default ones included.

    Parts and files are in it, lest a data set grows or changes between two runs.
    """
    known = [f.name for f in fields(cast("Any", source)) if f.init and f.name != "root"]
    values = {field: getattr(source, field) for field in known}
    values = {n: asdict(cast("Any", v)) if is_dataclass(v) else v for n, v in values.items()}
    names = "\n".join(part.name for part in parts).encode("utf-8", "surrogatepass")
    root = Path(getattr(source, "root", name)).resolve()
    return {
        "source": name,
        "root": str(root),
        "files": fingerprint_of(root),  # of tracks; what is published hardly changes
        **values,
        "layout": options.layout,
        "truth": asdict(options.truth) if options.truth else None,
        "parts": {
            "count": len(parts),
            "names": hashlib.sha256(names).hexdigest()[:16],
        },
    }


def _all_parts(
    task: Conversion,
    parts: list[Part],
    options: ConversionOptions,
    label: str,
    progress: Progress,
) -> Converted:
    """The results in order, of this run and of earlier ones; progress is shown."""
    found = {part: task.finished(part) for part in parts}
    results = {part: result for part, result in found.items() if result is not None}
    todo = [part for part in parts if part not in results]
    needed = team(options.workers, options.ray) if todo else nullcontext(ALONE)
    with progress.bar(label, len(parts), start=len(results)) as bar, needed as helpers:
        for part, result in helpers.as_done(task, todo):
            results[part] = result
            so_far = list(results.values())
            refused = all(r.damage for r in so_far) or len(so_far) == len(parts)
            if not refused or any(r.tracks for r in so_far):
                bar.at(len(so_far), _so_far(so_far))
        return Converted([results[part] for part in parts], helpers.worked)


def _so_far(results: list[PartResult]) -> str:
    tracks, scans = sum(r.tracks for r in results), sum(r.scans for r in results)
    return f"{counted(tracks, 'track')}, {counted(scans, 'scan')}"


def _nothing(root: str, results: list[PartResult]) -> str:
    damaged = [result.damage for result in results if result.damage]
    if len(damaged) == len(results) > 0:
        others = f" (and {len(damaged) - 1} more parts are damaged)" if len(damaged) > 1 else ""
        return f"{damaged[0].rstrip('.')}{others}."
    reasons = left_out(results)
    # Of equals the cause: an object has no scans left because they were left out.
    most = sorted(reasons, key=lambda why: (-reasons[why], not why.startswith("scan")))[:_NAMED]
    why = "; ".join(f"{reason.rstrip('.')}, {counted(reasons[reason], 'time')}" for reason in most)
    why = f" ({why})" if most else ""
    return f"{root}: no track came out of the source{why}; check it and its options."
