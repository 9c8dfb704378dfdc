# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape complete`: shape, pose, box and confidence of each scan."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from wildshape.cli.importing import uncollected
from wildshape.cli.options import AsJson, Device, Model, Overwrite, Refine, Together, Unit
from wildshape.cli.piped import Format, is_pipe
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.io.mesh_writer import MeshOrder

EXAMPLE = "wildshape complete scan.ply --out completed"

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
    arg(metavar="DIR", help="folder to write; or -, the shape of one scan as a file on stdout"),
]


@dataclass(frozen=True)
class Settings:
    """Complete the object of each scan, each scan on its own; with --track from all together.

    Writes DIR/TRACK/completed/SCAN.ply (the shape in that scan's sensor frame, metres), poses.txt
    (T_sensor_canonical) and objects.json (box, confidence); with --mesh a closed triangle mesh
    DIR/TRACK/mesh/SCAN.ply, too; with --boxes json kitti nuscenes argoverse2 all boxes in these
    formats below DIR/boxes. An interrupted run goes on where it stopped when repeated.

    In pipes, `wildshape complete - < scan.ply > shape.ply`: nothing but the shape (PLY; with --mesh
    a mesh, with --json an object with box, pose and points) goes to stdout.
    """

    input: Input
    out: Out = None
    model: Model = None
    unit: Unit = "m"
    device: Device = "auto"
    together: Together = False
    refine: Refine = "joint"
    mesh: Annotated[bool, arg(help="also write a closed mesh of each shape")] = False
    mesh_format: Annotated[Literal["ply", "obj", "glb"], arg(help="of the meshes")] = "ply"
    mesh_colours: Annotated[
        Literal["none", "confidence"],
        arg(help="blue where the mesh was measured, orange where it was guessed"),
    ] = "none"
    boxes: Annotated[
        tuple[Literal["json", "kitti", "nuscenes", "argoverse2"], ...],
        arg(
            metavar="FORMAT",
            help="json, kitti, nuscenes, argoverse2: also write all boxes so, below DIR/boxes",
        ),
    ] = ()
    calibration: Annotated[
        Path | None,
        arg(metavar="FILE", help="of KITTI (.txt) or Argoverse 2 (.feather), for these boxes"),
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
        from wildshape.cli.boxing import BoxOrder
        from wildshape.cli.results import Work, perform

    if settings.format != "auto":
        raise BadInputError(f"--format {settings.format}: is for a scan on stdin; leave it away.")
    boxes = BoxOrder(settings.boxes, settings.calibration)
    boxes.check()
    work = Work(
        command="complete",
        input=settings.input,
        out=out,
        model=settings.model,
        unit=settings.unit,
        device=settings.device,
        track=settings.together,
        refine=settings.refine,
        mesh=_mesh(settings),
        boxes=boxes,
    )
    perform(work, overwrite=settings.overwrite, as_json=settings.json)


def _to_stdout(settings: Settings) -> None:
    if settings.boxes or settings.calibration:
        raise BadInputError("--boxes: stdout holds one shape; name a folder with --out DIR.")
    with uncollected():
        from wildshape.cli.one_shape import Order, complete_to_stdout

    complete_to_stdout(
        Order(
            input=settings.input,
            format=settings.format,
            model=settings.model,
            unit=settings.unit,
            device=settings.device,
            mesh=_mesh(settings),
            json=settings.json,
        )
    )


def _mesh(settings: Settings) -> "MeshOrder | None":
    from wildshape.io.mesh_writer import MeshOrder

    coloured = settings.mesh_colours == "confidence"
    if coloured and not settings.mesh:
        raise BadInputError("--mesh-colours: there is no mesh to colour; pass --mesh, too.")
    return MeshOrder(settings.mesh_format, coloured) if settings.mesh else None
