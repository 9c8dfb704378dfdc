# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Calibrate the confidence of weights, and write them with it.

    python -m experiments.confidence --cad CAD --out confidence --write calibrated.safetensors
    python -m experiments.confidence --cad CAD --out confidence --category chair --model chair ...

Drives, or a depth camera's views of a category, are simulated, of procedural shapes and CAD models
of split `train`. Their truth is used, which training never sees; that is said in the checkpoint.
`wildshape evaluate` says of other data what the confidence is worth.
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
from experiments.tables.data import key
from safetensors import safe_open

from wildshape.cli.main import in_a_sentence
from wildshape.evaluation.cases import turn_track
from wildshape.evaluation.metrics import completion_error
from wildshape.evaluation.risk_coverage import rank_correlation
from wildshape.inference.predictor import Predictor, load
from wildshape.io.store.store import Store, is_finished_store, open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.checkpoint import SHIPPED, load_checkpoint, save_checkpoint, weights_file
from wildshape.method.confidence import ConfidenceFeatures, fit_calibration
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

_VEHICLES, _SCANS = ("car", "truck", "bus"), 12
_SENSORS: tuple[Literal["hdl64", "hdl32"], ...] = ("hdl64", "hdl32")
_SEED = 7100
_RIDGES, _FOLDS = (1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0), 10


@dataclass(frozen=True)
class Settings:
    """What to calibrate.

    Attributes:
        out: folder to write; what an earlier call simulated of the same choice is used again.
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
    def fitted_on(self) -> str:
        """What the weights say of it."""
        what = "drives" if self.category == "vehicle" else "views"
        cad = f", CAD {self.category}s of split train" if self.cad is not None else ""
        return f"simulated {what} with their truth: procedural {self.category}s{cad}"

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
        cd: true Chamfer distance, metres.
        track: number of each one's track.
    """

    features: list[ConfidenceFeatures]
    cd: list[float]
    track: list[int]


def drives(settings: Settings) -> Store:
    """What is fitted to, simulated once for each choice of it."""
    path = settings.out / f"train-{key(settings.configs, settings.cad)}"
    if not is_finished_store(path):
        with TemporaryDirectory() as folder, StoreWriter(path, {}, overwrite=True) as store:
            for config, seed in _sources(settings, Path(folder)):
                for track in simulate_tracks(config, seed, workers=1):
                    store.add(replace(track, name=f"{config.sensor}-{seed}-{track.name}"))
    return open_store(path)


def _sources(settings: Settings, folder: Path) -> Iterator[tuple[SimulationConfig, int]]:
    """What is simulated, with its seed: procedural shapes, then meshes if there are some."""
    seeded = [(config, _SEED + 7 * i) for i, config in enumerate(settings.configs)]
    yield from seeded
    if settings.cad is not None:
        rows = [row for row in rows_of(settings.cad, "train") if row["category"] in settings.meshes]
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
    found = Measured([], [], [])
    for index in range(len(store)):
        track = store.track(index)
        if track.sensor.kind == "lidar":
            track = turn_track(track, "yaw", 0)
        truth, shape = track.T_sensor_object, track.shape
        assert truth is not None
        assert shape is not None
        for i, item in enumerate(predictor.complete_many(track.scans, track.sensor)):
            local = truth[i].inverse().apply_numpy(item.points)
            found.features.append(ConfidenceFeatures(*item.features))
            found.cd.append(completion_error(local, shape).cd)
            found.track.append(index)
        print(f"{index + 1} of {len(store)}", flush=True)
    return found


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


def rewrite(model: Path, out: Path, **changes: Any) -> None:
    """The same weights, in the same precision, with some of their settings changed."""
    network, found = load_checkpoint(model)
    with safe_open(model, framework="pt") as file:
        half = all(file.get_tensor(name).dtype == torch.float16 for name in file.keys())  # noqa: SIM118
    save_checkpoint(out, network, replace(found, **changes), half=half)


def main(settings: Settings) -> None:
    """Fit, write."""
    model = weights_file(settings.model)
    found = measure(load(model), drives(settings))
    ridge = best_ridge(found)
    calibration = fit_calibration(found.features, np.asarray(found.cd), settings.fitted_on, ridge)
    print(f"ridge {ridge}: {calibration}")
    if settings.write is not None:
        rewrite(model, settings.write, calibration=calibration)


if __name__ == "__main__":
    torch.set_num_threads(1)
    with in_a_sentence():
        main(tyro.cli(Settings))
