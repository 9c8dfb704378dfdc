# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Fit the probabilities of heading, box and kind of weights of vehicles, and hold them to truth.

    python -m experiments.calibrate_confidence --out trust --write calibrated.safetensors
    python -m experiments.calibrate_confidence --out trust --check KITTI ARGOVERSE2

Fitted to simulated streets, whose other objects are no vehicles, and to simulated tracks behind
things, with rays and without. Nothing real is fitted to: `--check` names labelled tracks that the
figures are also of. Those of simulated data are of streets and sets of tracks left out in turn.
What was completed is kept in OUT. Prints tables and writes OUT/trust.json.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
import tyro
from experiments.confidence import rewrite
from experiments.trust_data import Both, Known, of_street, of_tracks

from wildshape.evaluation.calibration import auroc, calibration
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import atomic_write, write_json
from wildshape.io.inputs import open_tracks
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
from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.generate import simulate_tracks
from wildshape.simulate.street.drive_folder import write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

_FITTED_ON = "simulated streets and tracks with their truth: procedural vehicles"
_STREET = StreetConfig(scans=60)
_BEHIND = SimulationConfig(scans=6, occlusion=0.6, rays=2048)
_TRACKS = {
    "hdl64": replace(_BEHIND, tracks=60, varied=True),
    "hdl32": replace(_BEHIND, tracks=30, varied=True, sensor="hdl32"),
    "os1-128": replace(_BEHIND, tracks=25, varied=True, sensor="os1-128"),
}
STREETS = (5, 6, 7, 8, 9, 10, 11, 12)
_SEED, _RIDGE = 7301, 20.0  # scans of one object err alike
_KINDS = ("pose", "box", "kind")


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
    """

    out: Path
    model: Path = SHIPPED
    write: Path | None = None
    streets: tuple[int, ...] = STREETS
    share: float = 1.0
    check: tuple[Path, ...] = ()


def main(settings: Settings) -> None:
    """Complete, fit, hold, write."""
    settings.out.mkdir(parents=True, exist_ok=True)
    model = weights_file(settings.model)
    predictor = load(model)
    fitted = _simulated(predictor, settings)
    real = {path.name: _real(predictor, path, settings.out) for path in settings.check}
    trust = Trust(
        scan=fit([part.scan for part in fitted.values()], OF_SCAN, ScanFeatures._fields),
        track=fit([part.track for part in fitted.values()], OF_TRACK, TrackFeatures._fields),
        fitted_on=_FITTED_ON,
    )
    said = {
        "scan": held(trust.scan, _part(fitted, "scan"), _part(real, "scan"), OF_SCAN),
        "track": held(trust.track, _part(fitted, "track"), _part(real, "track"), OF_TRACK),
    }
    line = "python -m experiments.calibrate_confidence --out OUT"
    report = {"trust": asdict(trust), "held": said, "provenance": provenance(line)}
    write_json(settings.out / "trust.json", report)
    if settings.write is not None:
        rewrite(model, settings.write, trust=trust)


def _part(known: dict[str, Both], name: str) -> dict[str, Known]:
    return {key: getattr(both, name) for key, both in known.items()}


def _simulated(predictor: Predictor, settings: Settings) -> dict[str, Both]:
    out, found = settings.out, {}
    for seed in settings.streets:
        drive, cuts = out / f"street{seed}", out / f"clusters{seed}"

        def street(drive: Path = drive, cuts: Path = cuts, seed: int = seed) -> Both:
            write_drive(WholeDrive(_STREET, seed), drive)
            cuts.mkdir(exist_ok=True)
            return of_street(predictor, drive, cuts, seed)

        found[f"street{seed}"] = _kept(out / f"street{seed}.npz", street)
    for number, (name, config) in enumerate(_TRACKS.items()):
        config = replace(config, tracks=max(round(settings.share * config.tracks), 4))

        def behind(config: SimulationConfig = config, number: int = number) -> Both:
            tracks = list(simulate_tracks(config, _SEED + number, workers=1))
            parts = [of_tracks(predictor, tracks, rays) for rays in (False, True)]
            return Both(*map(Known.joined, zip(*parts)))

        found[name] = _kept(out / f"{name}.npz", behind)
    return found


def _real(predictor: Predictor, path: Path, out: Path) -> Both:
    source = open_tracks(path)
    tracks = [source[i] for i in range(len(source)) if source[i].label_size_m]
    return _kept(out / f"{path.name}.npz", lambda: of_tracks(predictor, tracks, rays=False))


def _kept(path: Path, make: Callable[[], Both]) -> Both:
    """What was completed before, or is now."""
    if not path.is_file():
        made = make()
        columns = {
            f"{part}_{name}": values
            for part, known in made._asdict().items()
            for name, values in known._asdict().items()
        }
        with atomic_write(path) as file:
            np.savez(file, **columns)
        print(f"{path.stem}: {len(made.scan.pose)} scans", flush=True)
    with np.load(path) as found:
        return Both(*(Known(*(found[f"{p}_{n}"] for n in Known._fields)) for p in Both._fields))


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
    calibrator: Calibrator, simulated: dict[str, Known], real: dict[str, Known], chosen: Chosen
) -> dict[str, dict[str, dict[str, float]]]:
    """Figures of what was left out in turn, of the real data, and of streets and real together."""
    names = ScanFeatures._fields if chosen is OF_SCAN else TrackFeatures._fields
    found: dict[str, tuple[Known, np.ndarray]] = {}
    for left, known in simulated.items():
        others = [part for name, part in simulated.items() if name != left]
        found[left] = (known, stated(fit(others, chosen, names), known, names))
    for name, known in real.items():
        found[name] = (known, stated(calibrator, known, names))
    streets = [name for name in simulated if name.startswith("street")]
    sets = {
        "streets": streets,
        "tracks": [name for name in simulated if name not in streets],
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
    main(tyro.cli(Settings))
