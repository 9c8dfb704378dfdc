# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Fit the probabilities of heading, box and kind of weights of vehicles, and hold them to truth.

    python -m experiments.calibrate_confidence --out trust --write calibrated.safetensors
    python -m experiments.calibrate_confidence --out trust --check KITTI ARGOVERSE2

Fitted to simulated streets, whose other objects are no vehicles, and to simulated tracks behind
things, with rays and without. Nothing real is fitted to: `--check` names labelled tracks that the
figures are also of, `--unseen` streets on which no feature was chosen. Those of other simulated
data are of streets and sets of tracks left out in turn.
What was completed is kept in OUT, a file a street or set of tracks, by several processes with
`--workers 2`: new weights need a new OUT. Prints tables and writes OUT/trust.json.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from experiments.confidence import rewrite
from experiments.tables.command import begin
from experiments.trust_data import Both, Known
from experiments.trust_parts import STREETS, Parts

from wildshape.errors import BadInputError
from wildshape.evaluation.calibration import auroc, calibration
from wildshape.io.atomic import write_json
from wildshape.io.output import provenance
from wildshape.method.checkpoint import SHIPPED, weights_file
from wildshape.method.trust import (
    OF_SCAN,
    OF_TRACK,
    Calibrator,
    Chosen,
    LogisticRegression,
    ScanFeatures,
    TrackFeatures,
    Trust,
    fit_logistic,
)

_FITTED_ON = "simulated streets and tracks with their truth: procedural vehicles"
_RIDGE = 20.0  # scans of one object err alike
_KINDS = ("pose", "box", "kind")
_ALIKE, _UNSEEN = "alike", "unseen"


@dataclass(frozen=True)
class Settings:
    """What to fit.

    Attributes:
        out: folder to write; what an earlier call completed is used again.
        model: checkpoint, or the name of weights shipped, of vehicles seen by LiDARs.
        write: where to write the weights with their probabilities.
        streets: seeds of the simulated streets.
        share: of the simulated tracks; below 1 to try it.
        check: folders of labelled tracks.
        unseen: seeds of streets that nothing is fitted to.
        workers: processes that complete streets and sets of tracks, one each at a time.
    """

    out: Path
    model: Path = SHIPPED
    write: Path | None = None
    streets: tuple[int, ...] = STREETS
    share: float = 1.0
    check: tuple[Path, ...] = ()
    unseen: tuple[int, ...] = ()
    workers: int = 1


def main(settings: Settings, command: str) -> None:
    """Complete, fit, hold, write; the command line says how it came about."""
    settings.out.mkdir(parents=True, exist_ok=True)
    model = weights_file(settings.model)
    parts = Parts(settings.out, model, settings.streets, settings.share)
    names = [*parts.names, *(path.name for path in settings.check)]
    for path in settings.check:
        if names.count(path.name) > 1:
            raise BadInputError(f"{path}: other data are called {path.name} too; rename one.")
    fitted = parts.simulated(settings.workers)
    others = {path.name: parts.real(path) for path in settings.check}
    others |= {f"{_UNSEEN} {seed}": parts.street(seed) for seed in settings.unseen}
    scans, tracks = _scans(fitted), _tracks(fitted)
    trust = Trust(
        scan=fit(list(scans.values()), OF_SCAN, ScanFeatures._fields),
        track=fit(list(tracks.values()), OF_TRACK, TrackFeatures._fields),
        fitted_on=_FITTED_ON,
    )
    said = {
        "scan": held(trust.scan, scans, _scans(others), OF_SCAN),
        "track": held(trust.track, tracks, _tracks(others), OF_TRACK),
    }
    report = {"trust": asdict(trust), "held": said, "provenance": provenance(command)}
    write_json(settings.out / "trust.json", report)
    if settings.write is not None:
        rewrite(model, settings.write, trust=trust)


def _scans(known: dict[str, Both]) -> dict[str, Known]:
    return {name: both.scan for name, both in known.items()}


def _tracks(known: dict[str, Both]) -> dict[str, Known]:
    tracks = {name: both.track for name, both in known.items()}
    alike = {f"{name} {_ALIKE}": both.alike for name, both in known.items()}
    return tracks | {name: part for name, part in alike.items() if len(part.kind)}


def fit(parts: list[Known], chosen: Chosen, names: tuple[str, ...]) -> Calibrator:
    """The three regressions on all parts together."""
    known = Known.joined(parts)
    return Calibrator(*(_line(known, kind, getattr(chosen, kind), names) for kind in _KINDS))


def _line(
    known: Known, kind: str, chosen: tuple[str, ...], names: tuple[str, ...]
) -> LogisticRegression:
    true = getattr(known, kind)
    rows = np.isfinite(true)
    columns = [names.index(name) for name in chosen]
    return fit_logistic(chosen, known.features[rows][:, columns], true[rows] > 0, ridge=_RIDGE)


def stated(calibrator: Calibrator, known: Known, names: tuple[str, ...]) -> np.ndarray:
    """`(n, 3)` probabilities of every row."""
    rows = [calibrator(dict(zip(names, row))) for row in known.features.tolist()]
    return np.array(rows).reshape(-1, len(_KINDS))


def held(
    calibrator: Calibrator, simulated: dict[str, Known], others: dict[str, Known], chosen: Chosen
) -> dict[str, dict[str, dict[str, float]]]:
    """Figures of what was left out in turn, of the other data, and of streets and real together."""
    names = ScanFeatures._fields if chosen is OF_SCAN else TrackFeatures._fields
    found: dict[str, tuple[Known, np.ndarray]] = {}
    for left, known in simulated.items():
        rest = [part for name, part in simulated.items() if name.split()[0] != left.split()[0]]
        found[left] = (known, stated(fit(rest, chosen, names), known, names))
    for name, known in others.items():
        found[name] = (known, stated(calibrator, known, names))
    alike = [name for name in simulated if name.endswith(_ALIKE)]
    streets = [name for name in simulated if name.startswith("street") and name not in alike]
    unseen = [name for name in others if name.startswith(_UNSEEN)]
    real = [name for name in others if not name.startswith(_UNSEEN) and not name.endswith(_ALIKE)]
    sets = {
        "streets": streets,
        "streets, views alike": alike,
        "tracks": [name for name in simulated if name not in (*streets, *alike)],
        _UNSEEN: [name for name in unseen if not name.endswith(_ALIKE)],
        f"{_UNSEEN}, views alike": [name for name in unseen if name.endswith(_ALIKE)],
        **{name: [name] for name in real},
        "streets and real": [*streets, *real],
    }
    print(f"\n| {'scan' if chosen is OF_SCAN else 'track'} | what | n | true | stated | error |"
          " Brier | constant | AUROC |\n| --- | --- |" + " ---: |" * 7)  # fmt: skip
    shown = {name: [found[part] for part in parts] for name, parts in sets.items() if parts}
    return {name: _figures(name, parts) for name, parts in shown.items()}


def _figures(name: str, parts: list[tuple[Known, np.ndarray]]) -> dict[str, dict[str, float]]:
    said = {}
    for column, kind in enumerate(_KINDS):
        true = np.concatenate([getattr(known, kind) for known, _ in parts])
        p = np.concatenate([found[:, column] for _, found in parts])[np.isfinite(true)]
        true = true[np.isfinite(true)] > 0
        ok = calibration(p, true)
        if ok is None:
            continue
        shown = (float(true.mean()), float(p.mean()), *ok, auroc(p, true))
        said[kind] = dict(zip(("true", "stated", *ok._fields, "auroc"), shown), n=len(p))
        cells = " | ".join("" if value is None else f"{value:.3f}" for value in shown)
        print(f"| {name} | {kind} | {len(p)} | {cells} |", flush=True)
    return said


if __name__ == "__main__":
    torch.set_num_threads(1)
    begin(main, Settings, "experiments.calibrate_confidence")
