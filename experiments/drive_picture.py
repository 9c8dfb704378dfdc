# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The README's first picture: a simulated drive from above, its vehicles found and completed.

python experiments/drive_picture.py docs/drive.webp
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

import wildshape
from wildshape.cli.main import in_a_sentence
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle, read_finished
from wildshape.report.drive.picture import write_drive_picture
from wildshape.simulate.street.drive_folder import write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive


@dataclass(frozen=True)
class Settings:
    """Draw a drive that no training has seen.

    Attributes:
        out: .webp or .png.
        scans: of the drive, ten a second.
        seed: of the street.
        shown: vehicles drawn below.
    """

    out: Annotated[Path, tyro.conf.Positional]
    scans: int = 100
    seed: int = 3
    shown: int = 4


def main(settings: Settings) -> None:
    with tempfile.TemporaryDirectory() as folder:
        street, out = Path(folder) / "street", Path(folder) / "found"
        write_drive(WholeDrive(StreetConfig(scans=settings.scans), settings.seed), street)
        wildshape.drive(street / "velodyne" / "0000", out)
        draw(settings, out)


def draw(settings: Settings, out: Path) -> None:
    found = read_finished(out)
    shown = nearest(found)[: settings.shown]
    write_drive_picture(found, open_drive(found.source), settings.out, shown)


def nearest(found: FinishedDrive) -> list[FoundVehicle]:
    """Those that came nearest first."""
    return sorted(found.vehicles, key=lambda one: one.nearest_m)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
