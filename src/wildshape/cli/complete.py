# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape complete`: shape, pose, box and confidence of each scan."""

from dataclasses import dataclass
from typing import Annotated, Literal

from tyro.conf import arg

from wildshape.cli.importing import uncollected
from wildshape.cli.options import AsJson, Device, Input, Model, OutFolder, Overwrite, Together, Unit

EXAMPLE = "wildshape complete scan.ply --out completed"


@dataclass(frozen=True)
class Settings:
    """Complete the object of each scan, each scan on its own; with --track from all together.

    Writes DIR/TRACK/completed/SCAN.ply (the shape in that scan's sensor frame, metres), poses.txt
    (T_sensor_canonical) and objects.json (box, confidence); with --mesh a closed triangle mesh
    DIR/TRACK/mesh/SCAN.ply, too. An interrupted run goes on where it stopped when repeated.
    """

    input: Input
    out: OutFolder
    model: Model = None
    unit: Unit = "m"
    device: Device = "auto"
    together: Together = False
    mesh: Annotated[bool, arg(help="also write a closed mesh of each shape")] = False
    mesh_format: Annotated[Literal["ply", "obj", "glb"], arg(help="of the meshes")] = "ply"
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Complete everything in the input.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    with uncollected():
        from wildshape.cli.results import Work, perform

    work = Work(
        command="complete",
        input=settings.input,
        out=settings.out,
        model=settings.model,
        unit=settings.unit,
        device=settings.device,
        track=settings.together,
        mesh=settings.mesh_format if settings.mesh else None,
    )
    perform(work, overwrite=settings.overwrite, as_json=settings.json)
