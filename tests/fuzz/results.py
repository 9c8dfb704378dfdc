# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of Wildshape's own files: packed stores, results of commands; and of meshes."""

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tests.cars import poses_of
from tests.datasets import write_argoverse2 as av2
from tests.datasets import write_kitti_tracking as tracking
from tests.datasets.street import street
from tests.fuzz.scans import track
from tests.fuzz.target import Arrays, Target, numbers_of
from tests.io.older_store import reseal

from wildshape.datasets.tracks.whole_tracks import Packed
from wildshape.evaluation.drives.found import drives_of, read_found
from wildshape.evaluation.drives.labels import Counting, read_labels
from wildshape.evaluation.drives.protocol import evaluate_drives
from wildshape.evaluation.drives.results import as_json
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.io.boxes.table import BoxRow, write_box_table
from wildshape.io.poses import write_poses
from wildshape.io.scans.writers import write_ply
from wildshape.io.store.join import finish_join
from wildshape.io.store.layout import INDEX_JSON, JOINING_JSON, WRITING_JSON
from wildshape.io.store.manifest import read_manifest, sealed
from wildshape.io.store.origin import origin_of
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.io.tracks import write_track
from wildshape.report.content import Report
from wildshape.report.page.folder import report_from_folder
from wildshape.report.statistics.statistics import statistics_of_store
from wildshape.report.viewer.sources import Source, from_results, worst_first
from wildshape.simulate.shapes.meshes import mesh_files, read_mesh

_SCAN = "000000"


def _write_store(folder: Path) -> None:
    with StoreWriter(folder, {"command": "a test", "left_out": {"scan: few": 3}}) as writer:
        writer.add(track())


def _build_store(folder: Path) -> None:
    _write_store(folder / "store")


def _read_store(folder: Path) -> Arrays:
    """As `train`, `info` and `convert packed` do."""
    store = open_store(folder)
    for found in store:
        yield from numbers_of(found)
    statistics_of_store(store, list(range(len(store))), lambda _: None)
    origin_of(folder)
    source = Packed(folder)
    for part in source.parts():
        for found in source.tracks_of(part):
            yield from numbers_of(found)


def _read_resealed(folder: Path) -> Arrays:
    """The same where damage was done before the checksums were taken."""
    with suppress(Exception):  # it stays damaged
        reseal(folder)
    return _read_store(folder)


def _build_joining(folder: Path) -> None:
    """A store whose parts were about to become one."""
    store = folder / "joining"
    _write_store(store)
    manifest = read_manifest(store)
    (store / INDEX_JSON).unlink()
    (store / WRITING_JSON).write_text('{"format": "wildshape-store", "version": 1}')
    shard = manifest["shards"][0]["file"]
    (store / ".parts").mkdir()
    (store / shard).rename(store / ".parts" / shard)
    plan = sealed({"moves": [[f".parts/{shard}", shard]], "manifest": manifest})
    (store / JOINING_JSON).write_text(json.dumps(plan))


def _read_joining(folder: Path) -> Arrays:
    finish_join(folder)
    return _read_store(folder)


def _entry(scan: str) -> dict[str, Any]:
    box = {"centre": [11, 3, 0], "size": [4, 1.8, 1.4], "quaternion_wxyz": [1, 0, 0, 0]}
    entry = {"scan": scan, "box": box, "confidence": 0.75, "refined": True, "seconds": 0.02}
    return entry | {"warning": "", "reasons": []}


def _scores() -> dict[str, Any]:
    where = {"track": "car", "scan": _SCAN}
    done = where | {"error": {"precision": 0.1, "coverage": 0.2}}
    pair = where | {"rotation_deg": 3.0, "rotation_sym_deg": 3.0, "translation_m": 0.1}
    method = {"name": "wildshape", "completions": [done], "registrations": [pair]}
    return {"runs": [{"seed": 0, "methods": [method]}]}


def _metrics() -> dict[str, Any]:
    figures = {"cd": 0.3, "acc30": 0.8, "rot_median_deg": 3.0, "trans_median_m": 0.1}
    figures |= {"std": {"acc30": 0.01}, "scans_counted": {"pose": 42}, "scans_skipped": {"few": 1}}
    provenance = {"command": "wildshape evaluate", "settings": {"data": "data", "unit": "m"}}
    methods = {"identity": {"cd": None, "acc30": 0.31}, "wildshape": figures}
    return {"rotate": "yaw", "seeds": [0, 1], "methods": methods, "provenance": provenance}


def _build_results(folder: Path) -> None:
    root = folder / "all"
    car, done = track(), root / "out" / "car"
    write_track(root / "data" / "car", car)
    for name, scan in zip(car.scan_names, car.scans):
        write_ply(done / "completed" / f"{name}.ply", scan)
    write_poses(done / "poses.txt", poses_of(car))
    said = {"track": "car", "input": str(root / "data"), "category": "car", "sensor": "lidar"}
    said |= {"scans": [_entry(name) for name in car.scan_names], "skipped": []}
    files = {
        "out/car/objects.json": said,
        "out/wildshape.json": {"command": "complete", "settings": {"unit": "m"}},
        "out/metrics.json": _metrics(),
        "out/scores.json": _scores(),
    }
    for name, data in files.items():
        (root / name).write_text(json.dumps(data))
    lines = [{"step": i, "loss": 1.0 / i, "branch_shares": [0.5, 0.5]} for i in (1, 2, 3)]
    (root / "out" / "log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


def _is_result(name: str) -> bool:
    return name.startswith("out/")


def _read_report(folder: Path) -> Arrays:
    """The report as `report` makes it, less its page."""
    report: Report = report_from_folder(folder / "out", folder / "data")
    for shown in report.objects:
        for cloud in shown.clouds:
            yield cloud.points


def _read_viewer(folder: Path) -> Arrays:
    """What `view` shows of results."""
    source: Source = from_results(folder / "out", folder / "data")
    for number in range(len(source.labels)):
        shown = source.track(number)
        yield from numbers_of(shown)
        for _, made in source.make(number, shown, 0):
            yield made.points
    worst_first(folder / "out" / "scores.json", "wildshape")


def _read_boxes(folder: Path) -> Arrays:
    """Results as `complete --boxes` turns them into other formats."""
    (folder / "out" / "boxes").mkdir(exist_ok=True)
    BoxFiles(("json", "nuscenes", "kitti", "argoverse2")).write(folder / "out")
    yield None


def _build_calibration(folder: Path) -> None:
    for name, colon in (("older", ":"), ("newer", "")):
        (folder / name).mkdir(parents=True)
        tracking.write_calibration(folder / name / "calib.txt", colon)
    av2.write_calibration(folder / "av2")


def _read_calibration(folder: Path) -> Arrays:
    path = next(iter(sorted(folder.rglob("*.*"))), folder / "calib.txt")
    kinds = {".txt": "kitti", ".feather": "argoverse2"}
    BoxFiles((kinds[path.suffix],), path).check()  # pyright: ignore[reportArgumentType]
    yield None


_ALL_COUNT = Counting(points=0, range_m=1e6)


def _build_drives(folder: Path) -> None:
    """What was found in two scans, and labels of them: of KITTI and simulated."""
    scene = street(2, points=400, eye=tracking.EYE)
    for kind in ("kitti", "simulated"):
        labels, found = folder / kind / "labels", folder / kind / "found"
        tracking.write_sequence(labels, scene, oxts=kind == "kitti")
        rows = [
            BoxRow(frame, 0.1 * frame, f"{one.track}", *one.box, 0.9, 50, moving=False)
            for frame, labelled in enumerate(read_labels(labels, _ALL_COUNT).frames)
            for one in labelled.labels
        ]
        write_box_table(found / "boxes.csv", rows)
        sizes = [scan.stat().st_size // 16 for scan in read_labels(labels, _ALL_COUNT).scans]
        frames = "0,000000,0,{}\n1,000001,,{}\n".format(*sizes)
        (found / "frames.csv").write_text(f"frame,scan,time,points\n{frames}")
        write_poses(found / "trajectory.txt", SE3.identity(2))
        for name in {row.track for row in rows}:
            write_track(found / "tracks" / name, replace(track(), name=name))
        if kind == "simulated":
            write_box_table(labels / "truth" / "0001.csv", rows)
            write_poses(labels / "poses" / "0001.txt", SE3.identity(2))


def _read_drives(folder: Path) -> Arrays:
    """As `evaluate-drive` does."""
    (found, labels) = drives_of(folder / "found", folder / "labels")[0]
    labelled = read_labels(labels, _ALL_COUNT)
    scores = evaluate_drives([read_found(found, len(labelled.frames))], [labelled])
    as_json(scores, _ALL_COUNT, {})
    for row in scores.rows:
        yield np.array([one.average_precision for one in row.detections], float)
        yield None if row.size_bias_m is None else np.array(row.size_bias_m)


def _build_meshes(folder: Path) -> None:
    import trimesh

    box = trimesh.creation.box((4.0, 1.8, 1.4))
    for kind in ("ply", "obj", "stl", "off", "glb", "gltf"):
        place = folder / kind
        place.mkdir(parents=True)
        made = box.export(file_type=kind)
        if isinstance(made, dict):
            for name, data in made.items():
                (place / name).write_bytes(data)
        else:
            data = made.encode() if isinstance(made, str) else made
            (place / f"car.{kind}").write_bytes(data)
    for name, kind, options in (
        ("car.stl", "stl_ascii", {}),
        ("car.ply", "ply", {"encoding": "ascii"}),
    ):
        (folder / f"text-{kind}").mkdir()
        box.export(folder / f"text-{kind}" / name, file_type=kind, **options)


def _read_meshes(folder: Path) -> Arrays:
    for path in mesh_files(folder):
        for metres in (True, False):
            solid = read_mesh(path, metres)
            yield solid.vertices
            yield solid.faces


TARGETS = (
    Target("store", _build_store, _read_store, 1.5),
    Target("store-resealed", _build_store, _read_resealed, 1, writes=True),
    Target("store-joining", _build_joining, _read_joining, 0.5, writes=True),
    Target("report", _build_results, _read_report, 1, attacked=_is_result),
    Target("viewer", _build_results, _read_viewer, 0.7, attacked=_is_result),
    Target("boxes", _build_results, _read_boxes, 0.5, attacked=_is_result, writes=True),
    Target("calibration", _build_calibration, _read_calibration, 0.7),
    Target("evaluate-drive", _build_drives, _read_drives, 1),
    Target("meshes", _build_meshes, _read_meshes, 1.5),
)
