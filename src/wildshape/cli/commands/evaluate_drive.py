# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape evaluate-drive`: boxes, tracks and trajectory of drives against labels."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Overwrite, option
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.io.output import Output

EXAMPLES = (
    "wildshape evaluate-drive found --labels street",
    "wildshape evaluate-drive found --labels training/label_02/0001.txt --out evaluation",
    "wildshape evaluate-drive drives --labels streets",
)

Folder = Annotated[
    Path,
    Positional,
    arg(metavar="DIR", help="a folder that `wildshape drive` wrote, or a folder of several"),
]
Labels = Annotated[
    Path,
    arg(
        metavar="L",
        help="a file of KITTI tracking's label_02, or a folder above it; of several drives, the"
        " folder of labels that have their names",
    ),
]


@dataclass(frozen=True)
class Settings:
    """Measure what was found in drives against KITTI tracking's labels or a simulated drive's.

    Prints average precision, recall, HOTA, tracks per vehicle, errors of size and trajectory,
    beside plain boxes around the same clusters. Several drives are measured as one.

    Attributes:
        out: write metrics.json, vehicles.json and table.md there.
        points: a labelled vehicle with fewer points in a scan does not count.
        range: farther boxes do not count, metres; not used with a simulated drive's labels.
    """

    folder: Folder
    labels: Labels
    out: Annotated[Path | None, option(metavar="DIR")] = None
    points: Annotated[int, arg(metavar="N")] = 100
    range: Annotated[float, arg(metavar="M")] = 60.0
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Evaluate, write and print.

    Raises:
        BadInputError: drives or labels that cannot be used, or that do not belong together.
    """
    from wildshape.cli.terminal import TERMINAL, answer, say
    from wildshape.evaluation.drives.doubts import doubts_of
    from wildshape.evaluation.drives.found import drives_of, read_found
    from wildshape.evaluation.drives.labels import Counting, read_labels
    from wildshape.evaluation.drives.protocol import evaluate_drives
    from wildshape.evaluation.drives.results import as_json, markdown, write_results
    from wildshape.io.output import command_line, provenance

    _check(settings)
    drives = drives_of(settings.folder, settings.labels)
    counting = Counting(points=settings.points, range_m=settings.range)
    with TERMINAL.bar("evaluating", len(drives) + 3) as bar:
        labelled, found = [], []
        for folder, path in drives:
            labelled.append(read_labels(path, counting))
            found.append(read_found(folder, len(labelled[-1].frames)))
            bar.at(len(found))
        output = _begin(settings)
        with nullcontext() if output is None else output.abandoned_if_refused():
            scores = evaluate_drives(found, labelled, lambda rows: bar.at(len(found) + rows))
    for told in doubts_of(found, labelled, scores):
        say(told)
    if settings.range != Counting.range_m and any(one.view is None for one in labelled):
        say(f"--range {settings.range:g} is no limit where labels are of all around, as these are")
    made = {**provenance(command_line()), "settings": _identity(settings)}
    if output is not None:
        write_results(output.path, scores, counting, made)
        output.finish()
    answer(markdown(scores, counting), as_json(scores, counting, made), as_json=settings.json)


def _check(settings: Settings) -> None:
    if settings.points < 0:
        raise BadInputError(f"--points {settings.points}: expected 0 or more.")
    if not settings.range > 0:
        raise BadInputError(f"--range {settings.range}: expected more than 0 metres.")


def _begin(settings: Settings) -> "Output | None":
    """The folder to write, claimed before minutes are spent on measuring."""
    from wildshape.evaluation.drives.results import FILES
    from wildshape.io.output import begin, keep_apart

    if settings.out is None:
        return None
    keep_apart(settings.out, settings.folder, settings.labels)
    identity = _identity(settings)
    return begin(settings.out, "evaluate-drive", identity, FILES, overwrite=settings.overwrite)


def _identity(settings: Settings) -> dict[str, Any]:
    return {
        "folder": str(settings.folder.resolve()),
        "labels": str(settings.labels.resolve()),
        "points": settings.points,
        "range": settings.range,
    }
