# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape export`: a model as one file for runtimes without this library."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Overwrite, option

EXAMPLES = (
    "wildshape export runs/mine --out model.onnx",
    "wildshape export airplane --out airplane.pt2",
)


@dataclass(frozen=True)
class Settings:
    """Write a model as ONNX (.onnx) or for torch.export.load (.pt2), and compare it with torch.

    The file takes raw scans (B, N, 3), sensor frame, metres, any B and N, and which of their points
    the network sees (B, M), see examples/06_onnx_inference.py. It gives completed points, poses
    (rotation, translation), confidence, cost and branch, all in the sensor frame: centring and the
    choice among poses are inside, refinement is not (as `load(raw=True)`). The largest difference
    to torch is said.
    """

    model: Annotated[
        Path | None,
        Positional,
        option(
            metavar="MODEL",
            help="checkpoint, folder of a run, or name of shipped weights; else the default ones",
        ),
    ] = None
    out: Annotated[Path, arg(metavar="FILE", help="file, .onnx or .pt2")] = Path("model.onnx")
    scans: Annotated[int, arg(metavar="N", help="scans, simulated, to compare on")] = 24
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Export and verify.

    Raises:
        BadInputError: model or output cannot be used, or the file does not do what torch does.
    """
    from wildshape.cli.terminal import answer
    from wildshape.inference.export.verify import export_model
    from wildshape.io.output import begin_file

    begin_file(settings.out, overwrite=settings.overwrite)
    found = export_model(settings.model, settings.out, settings.scans)
    size = settings.out.stat().st_size
    text = (
        f"{settings.out}: {size / 1e6:.1f} MB; largest difference to torch over {found.scans}"
        f" scans {found.largest_m:.1e} m"
    )
    if found.other_branch:
        text += f"; {found.other_branch} took another pose that costs as much"
    if found.other_cost:
        text += f"; {found.other_cost} got another cost or confidence by rounding"
    data = {"out": str(settings.out), "bytes": size, **found._asdict()}
    answer(text, data, as_json=settings.json)
