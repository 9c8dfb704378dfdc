# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Calibrate the confidence of weights, and measure it on scans that it was not fitted to.

    python -m experiments.confidence --cad CAD --out confidence --write calibrated.safetensors
    python -m experiments.confidence --cad CAD --out confidence --category chair --model chair ...

Drives, or a depth camera's views of a category, are simulated twice: once of procedural shapes and
CAD models of split `train`, which give the calibration, once with another seed and CAD models of
split `test`, which give the figures. The truth of simulated data is used, which training never
sees; that is said in the checkpoint. Writes OUT/confidence.json and .png and, with --write, the
weights with their calibration.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

import numpy as np
import torch
import tyro
from experiments.mesh_credits import rows_of
from safetensors import safe_open

from wildshape.cli.main import in_a_sentence
from wildshape.evaluation.cases import turn_track
from wildshape.evaluation.metrics import completion_error
from wildshape.evaluation.risk_coverage import RiskCoverage, rank_correlation, risk_coverage
from wildshape.geometry.transforms.se3 import stack
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import write_json
from wildshape.io.output import provenance
from wildshape.io.store.store import Store, is_finished_store, open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.checkpoint import SHIPPED, load_checkpoint, save_checkpoint, weights_file
from wildshape.method.confidence import ConfidenceFeatures, fit_calibration
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

_VEHICLES, _SCANS = ("car", "truck", "bus"), 12
_SENSORS: tuple[Literal["hdl64", "hdl32"], ...] = ("hdl64", "hdl32")
_SEEDS = {"train": 7100, "test": 9300}
_RIDGES, _FOLDS = (1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0), 10
_FITTED_ON = "simulated {what} with their truth: procedural {kind}, CAD {kind} of split train"


@dataclass(frozen=True)
class Settings:
    """What to calibrate.

    Attributes:
        out: folder to write; drives simulated by an earlier call are used again.
        model: checkpoint, or the name of weights shipped; the LiDAR's by default.
        cad: folder of CAD meshes with a manifest; without it procedural vehicles alone.
        write: where to write the weights with their calibration.
        tracks: for each of two sensors and each source; of a depth camera, for each source.
        category: vehicles, passed by two LiDARs, or what a depth camera sees five times.
    """

    out: Path
    model: Path = SHIPPED
    cad: Path | None = None
    write: Path | None = None
    tracks: int = 20
    category: Literal["vehicle", "airplane", "chair", "car"] = "vehicle"

    @property
    def meshes(self) -> tuple[str, ...]:
        """Categories of the manifest."""
        return _VEHICLES if self.category == "vehicle" else (self.category,)

    @property
    def configs(self) -> list[SimulationConfig]:
        """What is simulated of procedural shapes, and of meshes as well."""
        if self.category == "vehicle":
            return [
                SimulationConfig(tracks=self.tracks, scans=_SCANS, sensor=sensor)
                for sensor in _SENSORS
            ]
        return [SimulationConfig(tracks=self.tracks, sensor="depth-camera", category=self.category)]


class Measured(NamedTuple):
    """Completions of single scans; a LiDAR's each turned by its own yaw.

    Attributes:
        features: known without labels.
        plain: confidence that falls with the label-free cost alone.
        cd: true Chamfer distance, metres.
        rotation_deg: angle to the true pose, in the canonical frame that most scans agree on.
        track: number of each one's track.
    """

    features: list[ConfidenceFeatures]
    plain: list[float]
    cd: list[float]
    rotation_deg: list[float]
    track: list[int]


def drives(settings: Settings, split: str) -> Store:
    """The drives of a split, simulated once."""
    path = settings.out / split
    if not is_finished_store(path):
        with TemporaryDirectory() as folder, StoreWriter(path, {}, overwrite=True) as store:
            for config, seed in _sources(settings, split, Path(folder)):
                for track in simulate_tracks(config, seed, workers=1):
                    store.add(replace(track, name=f"{config.sensor}-{seed}-{track.name}"))
    return open_store(path)


def _sources(
    settings: Settings, split: str, folder: Path
) -> Iterator[tuple[SimulationConfig, int]]:
    """What is simulated, with its seed: procedural shapes, then meshes if there are some."""
    seeded = [(config, _SEEDS[split] + 7 * i) for i, config in enumerate(settings.configs)]
    yield from seeded
    if settings.cad is not None:
        rows = [row for row in rows_of(settings.cad, split) if row["category"] in settings.meshes]
        files = [settings.cad / row["file"] for row in rows]
        for config, seed in ((config, seed + 50) for config, seed in seeded):
            yield replace(config, meshes=_mixed(files, folder / str(seed), seed)), seed


def _mixed(files: list[Path], into: Path, seed: int) -> Path:
    """A folder of links to the meshes in a seeded order: tracks take them one after the other."""
    into.mkdir()
    for place, file in zip(np.random.default_rng(seed).permutation(len(files)), files):
        (into / f"{place:04d}_{file.name}").symlink_to(file.resolve())
    return into


def measure(predictor: Predictor, store: Store) -> Measured:
    """Complete all scans and hold them against their truth."""
    found, gauges = Measured([], [], [], [], []), []
    for index in range(len(store)):
        track = store.track(index)
        if track.sensor.kind == "lidar":
            track = turn_track(track, "yaw", 0)
        truth, shape = track.T_sensor_object, track.shape
        assert truth is not None
        assert shape is not None
        done = list(predictor.complete_many(track.scans, track.sensor))
        for i, item in enumerate(done):
            local = truth[i].inverse().apply_numpy(item.points)
            found.features.append(ConfidenceFeatures(*item.features))
            found.plain.append(1 / (1 + (item.cost / predictor.settings.cost_m[1]) ** 2))
            found.cd.append(completion_error(local, shape).cd)
            found.track.append(index)
        gauges.append(truth.rotation.mT @ stack([item.pose for item in done]).rotation)
        print(f"{index + 1} of {len(store)}", flush=True)
    found.rotation_deg.extend(_from_most(torch.cat(gauges)))
    return found


def _from_most(R_object_canonical: torch.Tensor) -> list[float]:
    """Angles to the one of them that the others are nearest to, degrees."""
    trace = torch.einsum("aij,bij->ab", R_object_canonical, R_object_canonical)
    angle = torch.rad2deg(torch.acos(((trace - 1) / 2).clamp(-1, 1)))
    return angle[angle.median(1).values.argmin()].tolist()


def best_ridge(found: Measured) -> float:
    """The ridge whose line orders the scans of tracks best that it was not fitted to."""
    cd, tracks = np.asarray(found.cd), np.asarray(found.track)
    order = {}
    for ridge in _RIDGES:
        foretold = np.zeros(len(cd))
        for fold in range(_FOLDS):
            out = tracks % _FOLDS == fold
            fitted = [features for features, left in zip(found.features, out) if not left]
            line = fit_calibration(fitted, cd[~out], ridge=ridge)
            foretold[out] = [line.expected(found.features[i]) for i in np.flatnonzero(out)]
        order[ridge] = rank_correlation(list(-foretold), found.cd) or 0.0
    return max(order, key=lambda ridge: order[ridge])


def figures(confidence: list[float], found: Measured) -> dict[str, object]:
    """Rank correlations, and the curve with its area."""
    curve = risk_coverage(confidence, found.cd)
    assert curve is not None
    return {
        "rank_correlation_cd": rank_correlation(confidence, found.cd),
        "rank_correlation_rotation": rank_correlation(confidence, found.rotation_deg),
        "risk_coverage_area_m": curve.area,
        "best_area_m": curve.best_area,
        "mean_cd_m": float(np.mean(found.cd)),
        "coverage": curve.coverage,
        "risk_m": curve.risk,
    }


def reliability(confidence: list[float], found: Measured, within: float) -> list[dict[str, float]]:
    """Stated against true shares of good completions, in five parts of equal size."""
    order = np.argsort(confidence)
    good = np.asarray(found.cd) <= within
    return [
        {"stated": float(np.asarray(confidence)[part].mean()), "true": float(good[part].mean())}
        for part in np.array_split(order, 5)
    ]


def draw(path: Path, curves: dict[str, RiskCoverage | None]) -> None:
    """The risk-coverage curves."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4, 3.8), layout="constrained")
    ax = figure.subplots()
    for name, curve in curves.items():
        assert curve is not None
        ax.plot(100 * np.asarray(curve.coverage), curve.risk, label=name)
    ax.set_xlabel("scans kept, the surest first, %")
    ax.set_ylabel("their mean Chamfer distance, m")
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)
    ax.legend(frameon=False)
    figure.savefig(path, dpi=130)


def rewrite(model: Path, out: Path, **changes: Any) -> None:
    """The same weights, in the same precision, with some of their settings changed."""
    network, found = load_checkpoint(model)
    with safe_open(model, framework="pt") as file:
        half = all(file.get_tensor(name).dtype == torch.float16 for name in file.keys())  # noqa: SIM118
    save_checkpoint(out, network, replace(found, **changes), half=half)


def main(settings: Settings) -> None:
    """Fit, measure, write."""
    model = weights_file(settings.model)
    predictor = load(model)
    seen = measure(predictor, drives(settings, "train"))
    views = settings.category != "vehicle"
    kind = f"{settings.category}s"
    fitted_on = _FITTED_ON.format(what="views" if views else "drives", kind=kind)
    ridge = best_ridge(seen)
    calibration = fit_calibration(seen.features, np.asarray(seen.cd), fitted_on, ridge)
    test = measure(predictor, drives(settings, "test"))
    after = [calibration.confidence(features) for features in test.features]
    report = {
        "before": figures(test.plain, test),
        "after": figures(after, test),
        "each_fact_alone": {
            name: rank_correlation([-features[i] for features in test.features], test.cd)
            for i, name in enumerate(ConfidenceFeatures._fields)
        },
        "reliability": reliability(after, test, calibration.within_m),
        "calibration": vars(calibration),
        "ridge": ridge,
        "scans": len(test.cd),
        "provenance": provenance("python -m experiments.confidence --cad CAD --out OUT"),
    }
    write_json(settings.out / "confidence.json", report)
    orders = {"cost alone": test.plain, "calibrated": after, "true error": [-c for c in test.cd]}
    curves = {name: risk_coverage(order, test.cd) for name, order in orders.items()}
    draw(settings.out / "confidence.png", curves)
    if settings.write is not None:
        rewrite(model, settings.write, calibration=calibration)
    for name in ("before", "after"):
        found = report[name]
        assert isinstance(found, dict)
        print(name, {key: value for key, value in found.items() if isinstance(value, float)})


if __name__ == "__main__":
    torch.set_num_threads(1)
    with in_a_sentence():
        main(tyro.cli(Settings))
