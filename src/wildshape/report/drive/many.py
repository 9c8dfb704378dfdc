# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Drives with their pages: one by every core, many by a core each or over a Ray cluster."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from wildshape.drives.clock import Watch, silent
from wildshape.drives.config import DriveConfig
from wildshape.drives.result import REPORT, DriveResult
from wildshape.drives.run import drive
from wildshape.drives.tracking.detections import DetectionFile
from wildshape.drives.writing.files import DriveFiles
from wildshape.errors import BadInputError
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import released_after
from wildshape.io.progress import SILENT, Progress
from wildshape.parallel.team import Team, cores, team
from wildshape.report.drive.page import write_drive_report

if TYPE_CHECKING:
    from wildshape.drives.adapting.adapt import Adaptation

_CONFIG, _NO_FILES = DriveConfig(), DriveFiles()


@dataclass(frozen=True)
class DriveAndPage:
    """`drive` of a source into a folder, and its `report.html`.

    Attributes:
        topic: see `drive`, as `config`, `files`, `detections`, `adapt` and `overwrite`.
        report: write the page, too, where there is none.
        workers: processes for one drive.
    """

    predictor: Predictor
    topic: str | None = None
    config: DriveConfig = _CONFIG
    files: DriveFiles = _NO_FILES
    detections: DetectionFile | None = None
    adapt: "Adaptation | None" = None
    report: bool = True
    workers: int | Team | None = None
    overwrite: bool = False

    def find(self, source: Path, out: Path, watch: Watch = silent) -> DriveResult:
        """One drive.

        Raises:
            BadInputError: source, detections or output cannot be used.
            MissingExtraError: a library is not installed.
        """
        with released_after(out), team(self.workers) as helpers:
            found = drive(
                source,
                out,
                self.config,
                topic=self.topic,
                predictor=self.predictor,
                workers=helpers,
                files=self.files,
                detections=self.detections,
                adapt=self.adapt,
                overwrite=self.overwrite,
                watch=watch,
            )
            if self.report and not (out / REPORT).is_file():
                watch("report", 0, 1)
                write_drive_report(out, helpers)
                watch("report", 1, 1)
        return found

    def __call__(self, place: tuple[Path, Path]) -> tuple[Path, DriveResult | BadInputError]:
        """Source and output; a drive that cannot be used holds up no other."""
        source, out = place
        try:
            return source, self.find(source, out)
        except BadInputError as error:
            return source, error


@dataclass(frozen=True)
class DrivesResult:
    """What was found in many drives.

    Attributes:
        found: in the order of the drives.
        refused: sources that cannot be used, and why.
        workers: how many did the work.
    """

    found: list[DriveResult]
    refused: dict[Path, str]
    workers: int


def drive_many(
    task: DriveAndPage,
    folders: Mapping[Path, Path],
    *,
    workers: int | None = None,
    ray: str | None = None,
    progress: Progress = SILENT,
) -> DrivesResult:
    """Each drive by one worker; a drive whose worker is killed goes on with another.

    `folders`: the output of each source; `workers`: in all, None: one a core; `ray`: address of a
    cluster in place of this machine, where all paths are the same.

    Raises:
        BadInputError: no cluster there, or a drive killed every worker.
        MissingExtraError: a library is not installed.
    """
    each = (workers or cores()) // max(len(folders), 1) if ray is None else 1
    task = replace(task, workers=max(each, 1))
    places = [(source.absolute(), out.absolute()) for source, out in folders.items()]
    results: dict[Path, DriveResult | BadInputError] = {}
    with team(workers, ray) as helpers, progress.bar("drives", len(folders)) as bar:
        for source, result in helpers.as_done(task, places):
            results[source] = result
            bar.at(len(results), source.name)
        worked = helpers.worked
    ordered = {source: results[source] for source, _ in places}
    return DrivesResult(
        [one for one in ordered.values() if isinstance(one, DriveResult)],
        {source: str(why) for source, why in ordered.items() if isinstance(why, BadInputError)},
        worked,
    )
