# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape report`: one HTML page of what other commands wrote."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from wildshape.cli.commands import uncollected
from wildshape.cli.options import AsJson, Overwrite, option

EXAMPLES = (
    "wildshape report completed --out completed/report.html",
    "wildshape report runs/cars",
    "wildshape report found",
)

Folder = Annotated[
    Path,
    Positional,
    arg(metavar="DIR", help="the --out of drive, complete, register, train or evaluate(-drive)"),
]
OutFile = Annotated[
    Path | None, option(metavar="FILE", help="page to write; by default DIR/report.html")
]
Inputs = Annotated[
    Path | None, option(metavar="INPUT", help="the scans, if they are no longer where they were")
]


@dataclass(frozen=True)
class Settings:
    """Draw results as one self-contained HTML page: objects in 3D, tables, curves, cost.

    Of a drive: its scene over time, and each vehicle with its shape.
    """

    folder: Folder
    out: OutFile = None
    inputs: Inputs = None
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Write the page.

    Raises:
        BadInputError: nothing there to report, or the page exists.
    """
    with uncollected():
        from wildshape.cli.terminal import answer
        from wildshape.drives.writing.folder import is_drive
        from wildshape.io.output import begin_file
        from wildshape.report.drive.page import report_from_drive
        from wildshape.report.page.folder import report_from_folder
        from wildshape.report.page.html import write_report

    out = settings.out or settings.folder / "report.html"
    begin_file(out, overwrite=settings.overwrite)
    read = report_from_drive if is_drive(settings.folder) else report_from_folder
    found = read(settings.folder, settings.inputs)
    write_report(found, out)
    data = {"out": str(out), "objects": len(found.objects), "tables": len(found.tables)}
    answer(f"the report is {out}", data, as_json=settings.json)
