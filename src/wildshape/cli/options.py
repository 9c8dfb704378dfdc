# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share, as types; nothing heavy is imported here."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

Input = Annotated[
    Path,
    Positional,
    arg(
        metavar="INPUT",
        help="a scan file, a TRACK folder, a DATASET folder of tracks, or a packed store",
    ),
]
Data = Annotated[
    Path,
    Positional,
    arg(metavar="DATA", help="a packed store, or a DATASET folder of track folders"),
]
OutFolder = Annotated[Path, arg(metavar="DIR", help="folder to write")]
Model = Annotated[
    Path | None,
    arg(
        metavar="M", help="checkpoint, folder of a run, or name of shipped weights; else `default`"
    ),
]
Unit = Annotated[Literal["m", "cm", "mm"], arg(help="of the coordinates in the files")]
Overwrite = Annotated[bool, arg(help="replace an earlier output")]
AsJson = Annotated[bool, arg(name="json", help="one JSON object on stdout, for machines")]
Device = Annotated[
    Literal["auto", "cpu", "cuda"], arg(help="auto takes the GPU where there is one")
]
Layout = Annotated[
    Literal["packed", "folders"],
    arg(help="one packed store, or track folders with a file a scan"),
]
Refine = Annotated[
    Literal["joint", "graph"],
    arg(help="with --track: all scans onto each other; graph: also each onto its neighbours"),
]
Together = Annotated[
    bool, arg(name="track", help="use all scans of a track together: one shape, posed in each")
]
