# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape complete`: shape, pose, box and confidence of each scan."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from wildshape.cli.importing import uncollected
from wildshape.cli.input.pipe import Format, is_pipe
from wildshape.cli.options import (
    AT_ORIGIN,
    AsJson,
    Device,
    Model,
    Origin,
    Overwrite,
    Together,
    Unit,
    listed,
    option,
)
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.io.scans.writers import MeshOrder

EXAMPLES = (
    "wildshape complete scan.ply --out completed",
    "wildshape complete mytracks/car-17 --out car-17 --track --mesh",
    "wildshape complete mytracks --out completed --boxes json,kitti",
    "wildshape complete - --mesh < scan.ply > mesh.ply",
)

Input = Annotated[
    Path,
    Positional,
    arg(
        metavar="INPUT",
        help="a scan file, a TRACK folder, a DATASET folder of tracks, or a packed store; or -,"
        " a scan on stdin",
    ),
]
Out = Annotated[
    Path | None,
    option(metavar="DIR", help="folder to write; or -, the shape of one scan as a file on stdout"),
]


@dataclass(frozen=True)
class Settings:
    """Complete the object of each scan, each scan on its own; with --track from all together.

    Writes DIR/TRACK/completed/SCAN.ply (the shape in that scan's sensor frame, metres), poses.txt
    (T_sensor_canonical) and objects.json (box, confidence); with --mesh a closed triangle mesh
    DIR/TRACK/mesh/SCAN.ply, too; with --boxes json,kitti,nuscenes,argoverse2 all boxes in these
    formats below DIR/boxes. An interrupted run goes on where it stopped when repeated.

    In pipes, `wildshape complete - < scan.ply > shape.ply`: nothing but the shape (PLY; with --mesh
    a mesh, with --json an object with box, pose and points) goes to stdout.
    """

    input: Input
    out: Out = None
    model: Model = None
    unit: Unit = "m"
    origin: Origin = AT_ORIGIN
    device: Device = "auto"
    together: Together = False
    mesh: Annotated[bool, arg(help="also write a closed mesh of each shape")] = False
    mesh_format: Annotated[Literal["ply", "obj", "glb"], arg(help="of the meshes")] = "ply"
    mesh_colours: Annotated[
        Literal["none", "confidence"],
        arg(help="blue where the mesh was measured, orange where it was guessed"),
    ] = "none"
    boxes: Annotated[
        tuple[str, ...],
        listed("A,B"),
        option(help="json, kitti, nuscenes, argoverse2: also write all boxes so, below DIR/boxes"),
    ] = ()
    calibration: Annotated[
        Path | None,
        option(metavar="FILE", help="of KITTI (.txt) or Argoverse 2 (.feather), for these boxes"),
    ] = None
    format: Format = "auto"
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Complete everything in the input.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    if is_pipe(settings.out) or (is_pipe(settings.input) and settings.out is None):
        _to_stdout(settings)
    elif settings.out is None:
        raise BadInputError("complete needs --out DIR to write to; --out - is stdout.")
    elif is_pipe(settings.input):
        raise BadInputError(
            f"--out {settings.out}: a scan from stdin is completed to stdout; leave --out away, or"
            " name the scan's file."
        )
    else:
        _to_folder(settings, settings.out)


def _to_folder(settings: Settings, out: Path) -> None:
    with uncollected():
        from wildshape.cli.results.boxes import BoxOrder
        from wildshape.cli.results.write import Work, perform
        from wildshape.io.scans.points import Coordinates

    if settings.format != "auto":
        raise BadInputError(f"--format {settings.format}: is for a scan on stdin; leave it away.")
    boxes = BoxOrder(settings.boxes, settings.calibration)
    boxes.check()
    work = Work(
        command="complete",
        input=settings.input,
        out=out,
        model=settings.model,
        coordinates=Coordinates(settings.unit, settings.origin),
        device=settings.device,
        track=settings.together,
        mesh=_mesh(settings),
        boxes=boxes,
    )
    perform(work, overwrite=settings.overwrite, as_json=settings.json)


def _to_stdout(settings: Settings) -> None:
    if settings.boxes or settings.calibration:
        raise BadInputError("--boxes: stdout holds one shape; name a folder with --out DIR.")
    with uncollected():
        from wildshape.cli.results.one_shape import Order, complete_to_stdout
        from wildshape.io.scans.points import Coordinates

    complete_to_stdout(
        Order(
            input=settings.input,
            format=settings.format,
            model=settings.model,
            coordinates=Coordinates(settings.unit, settings.origin),
            device=settings.device,
            mesh=_mesh(settings),
            json=settings.json,
        )
    )


def _mesh(settings: Settings) -> "MeshOrder | None":
    from wildshape.io.scans.writers import MeshOrder

    coloured = settings.mesh_colours == "confidence"
    if coloured and not settings.mesh:
        raise BadInputError("--mesh-colours: there is no mesh to colour; pass --mesh, too.")
    return MeshOrder(settings.mesh_format, coloured) if settings.mesh else None
