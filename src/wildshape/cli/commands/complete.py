# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape complete`: shape, pose, box and confidence of each scan."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from wildshape.cli.commands import uncollected
from wildshape.cli.options import (
    DEFAULT_SCANS,
    DEFAULT_WORK,
    Boxes,
    Format,
    Scans,
    Work,
    check_mesh_format,
    is_pipe,
    option,
    refuse_folder_options,
)
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.inference.folders.complete_folder import FolderOptions
    from wildshape.io.scans.writers import CloudFormat, MeshFiles
    from wildshape.records import Completion, Track

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
    DIR/TRACK/mesh/SCAN.ply, too; with --boxes all boxes in the formats of data sets, below
    DIR/boxes. An interrupted run goes on where it stopped when repeated.

    In pipes, `wildshape complete - < scan.ply > shape.ply`: nothing but the shape (PLY or
    --cloud-format; with --mesh a mesh, with --json an object with box, pose and points) goes to
    stdout.
    """

    input: Input
    out: Out = None
    scans: Scans = DEFAULT_SCANS
    rays: Annotated[
        Path | None,
        option(metavar="FILE", help="rays of one scan's frame that passed the object by (.npz)"),
    ] = None
    cloud_format: Annotated[Literal["ply", "pcd"], arg(help="of the shapes")] = "ply"
    mesh: Annotated[bool, arg(help="also write a closed mesh of each shape")] = False
    mesh_format: Annotated[Literal["ply", "obj", "glb"], arg(help="of the meshes")] = "ply"
    mesh_colours: Annotated[
        Literal["none", "confidence"],
        arg(help="confidence: blue where the mesh was measured, orange where it was guessed"),
    ] = "none"
    boxes: Boxes = ()
    calibration: Annotated[
        Path | None,
        option(metavar="FILE", help="KITTI's (.txt) or Argoverse 2's (.feather), for --boxes"),
    ] = None
    format: Format = "auto"
    work: Work = DEFAULT_WORK


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
        from wildshape.cli.terminal import TERMINAL, conclude
        from wildshape.inference.folders.complete_folder import complete_folder

    if settings.format != "auto":
        raise BadInputError(f"--format {settings.format}: is for a scan on stdin; leave it away.")
    conclude(
        complete_folder(settings.input, out, _options(settings), TERMINAL),
        as_json=settings.scans.json,
    )


def _options(settings: Settings) -> "FolderOptions":
    from wildshape.inference.folders.box_files import BoxFiles

    wanted = bool(settings.boxes or settings.calibration)
    boxes = BoxFiles(settings.boxes, settings.calibration) if wanted else None
    return replace(
        settings.scans.of_folder(settings.work),
        rays=settings.rays,
        clouds=settings.cloud_format,
        mesh=_mesh(settings),
        boxes=boxes,
    )


def _mesh(settings: Settings) -> "MeshFiles | None":
    from wildshape.io.scans.writers import MeshFiles

    coloured = settings.mesh_colours == "confidence"
    if coloured and not settings.mesh:
        raise BadInputError("--mesh-colours: there is no mesh to colour; pass --mesh, too.")
    check_mesh_format(settings.mesh_format, mesh=settings.mesh)
    return MeshFiles(settings.mesh_format, coloured) if settings.mesh else None


def _to_stdout(settings: Settings) -> None:
    """One scan completed to stdout: a PLY, a mesh, or one JSON object with the points."""
    if settings.boxes or settings.calibration:
        raise BadInputError("--boxes: stdout holds one shape; name a folder with --out DIR.")
    refuse_folder_options(
        settings.work, overwrite=settings.scans.overwrite, prints="complete to stdout"
    )
    with uncollected():
        from wildshape.cli.pipe import refuse_terminal, write_stdout
        from wildshape.cli.terminal import answer, say
        from wildshape.inference.confidence import reasons_sentence
        from wildshape.inference.predictor import load

    mesh = _mesh(settings)
    if mesh is not None and settings.scans.json:
        raise BadInputError("--mesh: with --json stdout holds points; leave one of the two away.")
    if settings.cloud_format != "ply" and (mesh is not None or settings.scans.json):
        raise BadInputError(
            "--cloud-format: with --mesh or --json stdout holds no cloud; drop one."
        )
    if not settings.scans.json:
        refuse_terminal()
    track = _one_scan(settings)
    predictor = load(settings.scans.network.model, settings.scans.network.device)
    (done,) = predictor.complete_checked(track.scans, track.sensor, rays=track.rays)
    if done.reasons:
        say(reasons_sentence(done))
    if settings.scans.json:
        answer("", _as_json(track.scan_names[0], done), as_json=True)
    else:
        write_stdout(_as_file(done, track, mesh, settings.cloud_format))


def _one_scan(settings: Settings) -> "Track":
    from wildshape.cli.pipe import as_file
    from wildshape.cli.terminal import say
    from wildshape.io.inputs import open_tracks, with_rays

    with as_file(settings.input, settings.format) as path:
        source = open_tracks(path, settings.scans.files.coordinates)
        if settings.rays is not None:
            source = with_rays(source, settings.rays, settings.scans.files.coordinates)
        track = source.single("--out -")
    if len(track.scans) != 1:
        raise BadInputError(
            f"{settings.input}: holds {len(track.scans)} scans, but --out - writes one shape; name"
            " the file of one scan, or a folder for --out."
        )
    for told in source.doubts:
        say(told)
    return track


def _as_json(name: str, done: "Completion") -> dict[str, object]:
    """What `objects.json` says of a scan, its pose, and its points to a tenth of a millimetre."""
    from wildshape.inference.folders.complete_folder import describe

    pose = done.pose.matrix.tolist()
    points = [[round(x, 4) for x in row] for row in done.points.tolist()]
    return {**describe(name, done), "T_sensor_canonical": pose, "points": points}


def _as_file(
    done: "Completion", track: "Track", mesh: "MeshFiles | None", clouds: "CloudFormat"
) -> bytes:
    from wildshape.io.scans.writers import cloud_bytes, mesh_bytes

    if mesh is None:
        return cloud_bytes(done.points, clouds)
    return mesh_bytes(done.mesh(track.scans[0] if mesh.coloured else None), mesh.kind)
