# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One scan completed to stdout: a PLY, a mesh, or one JSON object with the points."""

from dataclasses import dataclass
from pathlib import Path

from wildshape.cli.input.pipe import as_file, refuse_terminal, write_stdout
from wildshape.cli.input.tracks import Reading
from wildshape.cli.models import load_model
from wildshape.cli.options import Device
from wildshape.cli.results.tally import doubt
from wildshape.cli.terminal import answer, say
from wildshape.errors import BadInputError
from wildshape.inference.completed_files import describe
from wildshape.io.scans.points import Coordinates
from wildshape.io.scans.writers import MeshOrder, mesh_bytes, ply_bytes
from wildshape.records import Completion, Points, Track


@dataclass(frozen=True)
class Order:
    """What to complete and how to say it.

    Attributes:
        input: a scan file, or `-`.
        format: of stdin.
        model: checkpoint, None for the shipped one.
        coordinates: of the scan.
        device: `auto`, `cpu` or `cuda`.
        mesh: write a mesh instead of points.
        json: one JSON object instead of a file.
    """

    input: Path
    format: str
    model: Path | None
    coordinates: Coordinates
    device: Device
    mesh: MeshOrder | None
    json: bool


def complete_to_stdout(order: Order) -> None:
    """Complete the scan.

    Raises:
        BadInputError: not exactly one usable scan, no such model, or stdout is a terminal.
    """
    if not order.json:
        refuse_terminal()
    track = _one_scan(order)
    scan = track.scans[0]
    done = load_model(order.model, order.device).complete(scan, track.sensor)
    if done.reasons:
        say(doubt(done))
    if order.json:
        answer("", _as_json(track.scan_names[0], done), as_json=True)
    else:
        write_stdout(_as_file(done, scan, order.mesh))


def _one_scan(order: Order) -> Track:
    with as_file(order.input, order.format) as path:
        reading = Reading(path, order.coordinates)
        track = reading.single("--out -")
    if len(track.scans) != 1:
        raise BadInputError(
            f"{order.input}: holds {len(track.scans)} scans, but --out - writes one shape; name"
            " the file of one scan, or a folder for --out."
        )
    if reading.dropped:
        say(reading.dropped)
    return track


def _as_json(name: str, done: Completion) -> dict[str, object]:
    """What `objects.json` says of a scan, its pose, and its points to a tenth of a millimetre."""
    pose = done.pose.matrix.tolist()
    points = [[round(x, 4) for x in row] for row in done.points.tolist()]
    return {**describe(name, done), "T_sensor_canonical": pose, "points": points}


def _as_file(done: Completion, scan: Points, mesh: MeshOrder | None) -> bytes:
    if mesh is None:
        return ply_bytes(done.points)
    return mesh_bytes(done.mesh(scan if mesh.coloured else None), mesh.kind)
