# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape export`: a model as one file for runtimes without this library."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Overwrite, option
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.inference.export.verify import Difference

EXAMPLES = (
    "wildshape export runs/mine --out model.onnx",
    "wildshape export airplane --out airplane.pt2",
)
_SUFFIXES, _ALLOWED_M = (".onnx", ".pt2"), 1e-4


@dataclass(frozen=True)
class Settings:
    """Write a model as ONNX (.onnx) or for torch.export.load (.pt2), and compare it with torch.

    The file takes raw scans (B, N, 3), sensor frame, metres, any B and N, and which of their points
    the network sees (B, M), see examples/06_onnx_inference.py. It gives completed points, poses
    (rotation, translation), confidence, cost and branch, all in the sensor frame: centring and the
    choice among poses are inside. The largest difference to torch is said.
    """

    model: Annotated[
        Path | None,
        Positional,
        option(
            metavar="MODEL", help="checkpoint, or folder of a training run; else the shipped one"
        ),
    ] = None
    out: Annotated[Path, arg(metavar="FILE", help="to write: .onnx or .pt2")] = Path("model.onnx")
    scans: Annotated[int, arg(metavar="N", help="compared with torch")] = 24
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Export and verify.

    Raises:
        BadInputError: model or output cannot be used, or the file does not do what torch does.
    """
    from wildshape.io.output import refuse_file

    suffix = settings.out.suffix.lower()
    if suffix not in _SUFFIXES:
        raise BadInputError(f"{settings.out}: give --out one of {', '.join(_SUFFIXES)}.")
    if settings.scans < 1:
        raise BadInputError(f"--scans {settings.scans}: compare at least one scan.")
    refuse_file(settings.out, overwrite=settings.overwrite)
    _export(settings, suffix)


def _export(settings: Settings, suffix: str) -> None:
    from wildshape.cli.terminal import answer
    from wildshape.inference.export import onnx, verify
    from wildshape.inference.predictor import load

    if suffix == ".onnx":
        onnx.require_onnx()
    predictor = load(settings.model, raw=True)
    if predictor.settings.network.backbone != "pcn":
        raise BadInputError(
            f"{settings.model}: its encoder is {predictor.settings.network.backbone}, and only"
            " networks with PCN's encoder are exported; train without --encoder."
        )
    scans = verify.rehearsal_scans(predictor.settings, settings.scans)
    write = onnx.write_onnx if suffix == ".onnx" else onnx.write_torch
    settings.out.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=settings.out.parent, prefix=".export.") as folder:
        draft = Path(folder) / f"model{suffix}"  # no file under its final name before it is checked
        write(draft, onnx.trace(predictor), onnx.describe(predictor))
        found = verify.compare(verify.open_exported(draft), predictor, scans)
        _refuse_other(settings.out, found)
        draft.replace(settings.out)
    size = settings.out.stat().st_size
    text = (
        f"{settings.out}: {size / 1e6:.1f} MB; largest difference to torch over {found.scans}"
        f" scans {found.largest_m:.1e} m"
    )
    if found.other_branch:
        text += f"; {found.other_branch} took another pose that costs as much"
    answer(
        text, {"out": str(settings.out), "bytes": size, **found._asdict()}, as_json=settings.json
    )


def _refuse_other(path: Path, found: "Difference") -> None:
    """Raise if an exported model does something else than torch."""
    if found.largest_m > _ALLOWED_M or 10 * found.other_branch > found.scans:
        raise BadInputError(
            f"{path}: not written, the exported model differs from torch by"
            f" {found.largest_m:.3g} m and chose another pose for {found.other_branch} of"
            f" {found.scans} scans; please report this with the model."
        )
