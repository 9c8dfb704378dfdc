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
from wildshape.drives.writing.finished import read_finished
from wildshape.report.drive.picture import write_drive_picture
from wildshape.simulate.street.drive_folder import write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

_SCANS, _STREET, _SHOWN = 100, 3, 4  # of a seed that no training has seen; vehicles drawn below


@dataclass(frozen=True)
class Settings:
    """Draw a drive.

    Attributes:
        out: .webp or .png.
    """

    out: Annotated[Path, tyro.conf.Positional]


def main(settings: Settings) -> None:
    with tempfile.TemporaryDirectory() as folder:
        street, out = Path(folder) / "street", Path(folder) / "found"
        write_drive(WholeDrive(StreetConfig(scans=_SCANS), _STREET), street)
        wildshape.drive(street / "velodyne" / "0000", out)
        found = read_finished(out)
        nearest = sorted(found.vehicles, key=lambda one: one.nearest_m)[:_SHOWN]
        write_drive_picture(found, open_drive(found.source), settings.out, nearest)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
