# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The demo's last stage: a simulated drive, every vehicle in it found, and its page."""

from dataclasses import dataclass
from pathlib import Path

from wildshape.drives.result import REPORT
from wildshape.drives.run import drive
from wildshape.errors import MissingExtraError
from wildshape.inference.predictor import Predictor
from wildshape.io.progress import Progress, counted
from wildshape.report.content import Figure
from wildshape.report.drive.page import report_from_drive
from wildshape.report.page.html import write_report
from wildshape.simulate.street.drive_folder import SEQUENCE, write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

STREET, FOUND = "drive/street", "drive/found"
PAGE = f"{FOUND}/{REPORT}"
_SEED = 3


@dataclass(frozen=True)
class DemoDrive:
    """What came of the drive: a sentence, and its picture, which leads to its page."""

    sentence: str
    figures: tuple[Figure, ...] = ()


def find_vehicles(out: Path, scans: int, predictor: Predictor, progress: Progress) -> DemoDrive:
    """Simulate a drive below `out`, find its vehicles, and draw them.

    `scans`: ten a second; 0 leaves the drive out.
    """
    if scans == 0:
        return DemoDrive("")
    with progress.bar("simulating a drive", scans) as bar:
        write_drive(WholeDrive(StreetConfig(scans=scans), _SEED), out / STREET, bar.at)
    try:
        with progress.bar("finding its vehicles", 0) as bar:
            found = drive(
                out / STREET / "velodyne" / SEQUENCE,
                out / FOUND,
                predictor=predictor,
                overwrite=(out / FOUND).exists(),
                watch=lambda stage, done, total: bar.at(done, stage, total=total),
            )
    except MissingExtraError as error:
        progress.say(f"the drive is left out: {error}")
        return DemoDrive(f"The drive was left out: {error}")
    report = report_from_drive(found.out)
    write_report(report, found.out / REPORT)
    vehicles = counted(len(found.vehicles), "vehicle")
    sentence = f"In a simulated drive of {counted(scans, 'scan')} {vehicles} were found"
    figures = ()
    if report.scene is not None:
        title = "The drive from above: click it to play the drive and to open every vehicle"
        figures = (Figure(title, report.scene.picture, wide=True, kind="webp", to=PAGE),)
    return DemoDrive(f"{sentence}; {PAGE} plays it.", figures)
