# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share, as types; nothing heavy is imported here."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg
from tyro.constructors import PrimitiveConstructorSpec

from wildshape.errors import BadInputError
from wildshape.inference.folders.box_files import BOX_FORMATS

if TYPE_CHECKING:
    from wildshape.inference.folders.complete_folder import FolderOptions
    from wildshape.io.scans.points import Coordinates


def _hint(default: str) -> str:
    """Nothing where nothing is the default."""
    return "" if default in ("None", "", "''") else f"(default: {default})"


option = partial(arg, help_behavior_hint=_hint)


def listed(
    metavar: str,
    read: Callable[[str], Any] = str,
    *,
    count: int | None = None,
    words: Literal[1, "*"] = "*",
) -> PrimitiveConstructorSpec[Any]:
    """An option of several values with commas between them.

    Args:
        metavar: how they are shown; with commas.
        read: makes a value of a word.
        count: how many values there must be; None: any number.
        words: `*`: they may stand apart, too, where no positional argument follows.
    """

    def values(typed: Sequence[str]) -> tuple[Any, ...]:
        found = tuple(read(word) for word in _apart(typed))
        if count not in (None, len(found)):
            raise ValueError(f"expected {count} values, got {len(found)}")
        return found

    return PrimitiveConstructorSpec(
        nargs=words,
        metavar=metavar,
        instance_from_str=values,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [",".join(map(str, value or ()))],
    )


def _apart(words: Sequence[str]) -> list[str]:
    """Words apart at their commas; a file whose name holds one is a word."""
    parts = [[word] if Path(word).exists() else word.split(",") for word in words]
    return [part.strip() for words in parts for part in words if part.strip()]


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
    option(
        metavar="M", help="checkpoint, folder of a run, or name of shipped weights; else `default`"
    ),
]
Unit = Annotated[Literal["m", "cm", "mm"], arg(help="of the coordinates in the files")]
Place = tuple[float, float, float]


def _place(words: list[str]) -> Place:
    try:
        x, y, z = (float(word) for word in words[0].split(","))
    except ValueError:
        x = y = z = nan
    if not all(map(isfinite, (x, y, z))):
        raise ValueError(f"expected three numbers X,Y,Z, found '{words[0]}'")
    return x, y, z


Origin = Annotated[
    Place,
    PrimitiveConstructorSpec(
        nargs=1,
        metavar="X,Y,Z",
        instance_from_str=_place,
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda place: [",".join(f"{number:g}" for number in place)],
    ),
    arg(
        help="the sensor's position in the files' frame and unit, of scans that were moved into a"
        " map; results are in the sensor's frame"
    ),
]
AT_ORIGIN: Place = (0.0, 0.0, 0.0)
Overwrite = Annotated[bool, arg(help="replace an earlier output, once there is a new one")]
AsJson = Annotated[bool, arg(name="json", help="one JSON object on stdout, for machines")]
Device = Annotated[
    Literal["auto", "cpu", "cuda"], arg(help="auto takes the GPU where there is one")
]
Layout = Annotated[
    Literal["packed", "folders"],
    arg(help="one packed store, or track folders with a file per scan"),
]
Boxes = Annotated[
    tuple[str, ...],
    listed("A,B"),
    option(help=f"{', '.join(BOX_FORMATS)}: also write all boxes so, below DIR/boxes"),
]
Together = Annotated[
    bool, arg(name="track", help="use all scans of a track together: one shape, posed in each")
]

Format = Annotated[
    Literal["auto", "ply", "pcd", "bin", "npy", "npz", "xyz", "csv", "las", "laz"],
    arg(help="of a scan on stdin (`-`); auto tells all but bin, KITTI's bare numbers"),
]


def is_pipe(path: Path | None) -> bool:
    """Whether `-` was written."""
    return str(path) == "-"


@dataclass(frozen=True)
class NetworkOptions:
    """Which weights, and where they run."""

    model: Model = None
    device: Device = "auto"


@dataclass(frozen=True)
class FileOptions:
    """How the numbers in the files are to be understood."""

    unit: Unit = "m"
    origin: Origin = AT_ORIGIN

    @property
    def coordinates(self) -> "Coordinates":
        """The same for the library."""
        from wildshape.io.scans.points import Coordinates

        return Coordinates(self.unit, self.origin)


@dataclass(frozen=True)
class WorkOptions:
    """Who does the work."""

    workers: Annotated[
        int | None, option(metavar="N", help="processes; by default one per core")
    ] = None
    ray: Annotated[
        str | None,
        option(
            metavar="ADDRESS",
            help="work on the Ray cluster at this address; auto: the one that this machine belongs"
            " to, local: start one; all its machines must see the same files",
        ),
    ] = None


# Help lists each under a title of its name: `model options`.
Network = Annotated[NetworkOptions, OmitArgPrefixes, arg(name="model", prefix_name=False)]
Work = Annotated[WorkOptions, OmitArgPrefixes, arg(name="worker", prefix_name=False)]
DEFAULT_WORK = WorkOptions()


def refuse_folder_options(work: WorkOptions, *, overwrite: bool, prints: str) -> None:
    """Refuse options that change nothing where no folder is written; `prints`: what does not.

    Raises:
        BadInputError: one is given.
    """
    if work != DEFAULT_WORK or overwrite:
        raise BadInputError(
            f"{prints} writes no folder, of which --workers, --ray and --overwrite are; leave them"
            " out."
        )


Files = Annotated[FileOptions, OmitArgPrefixes, arg(name="file", prefix_name=False)]


def check_mesh_format(kind: str, *, mesh: bool) -> None:
    """Refuse a format of meshes where none is written.

    Raises:
        BadInputError: so it is.
    """
    if kind != "ply" and not mesh:
        raise BadInputError("--mesh-format: there is no mesh to write; pass --mesh, too.")


DEFAULT_NETWORK, DEFAULT_FILES = NetworkOptions(), FileOptions()


@dataclass(frozen=True)
class ScanOptions:
    """Which scans go together, and what becomes of results."""

    network: Network = DEFAULT_NETWORK
    files: Files = DEFAULT_FILES
    together: Together = False
    overwrite: Overwrite = False
    json: AsJson = False

    def of_folder(self, work: WorkOptions) -> "FolderOptions":
        """The same for the library; `work`: who does it."""
        from wildshape.inference.folders.complete_folder import FolderOptions

        return FolderOptions(
            model=self.network.model,
            device=self.network.device,
            coordinates=self.files.coordinates,
            track=self.together,
            workers=work.workers,
            ray=work.ray,
            overwrite=self.overwrite,
        )


Scans = Annotated[ScanOptions, OmitArgPrefixes, arg(name="scan", prefix_name=False)]
DEFAULT_SCANS = ScanOptions()
