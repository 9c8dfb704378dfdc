# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Drives measured: what another call left is neither pooled nor taken for one's own."""

import json
from pathlib import Path

from experiments.drives import Settings, main

from experiments import drives


def test_other_drives_in_the_same_folder_are_kept_apart(cad, tmp_path, monkeypatch):
    pooled, folders = [], []

    def noted(folder, *line):
        folder.mkdir(parents=True)
        folders.append(folder)
        if line[0] == "evaluate-drive":
            pooled.append({path.name for path in Path(line[1]).iterdir()})

    monkeypatch.setattr(drives, "_step", noted)
    monkeypatch.setattr(drives, "_table", lambda *of: "")
    for first, scans, meshes in ((21, 60, None), (101, 60, None), (101, 20, None), (101, 60, cad)):
        main(Settings(tmp_path, first, count=2, scans=scans, cad=meshes))
        assert pooled[-1] == {str(first), str(first + 1)}
    assert len(set(folders)) == len(folders)


def test_what_other_weights_found_is_not_measured_as_ones_own(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(drives, "_step", lambda folder, *line: done.append((line[0], folder)))
    monkeypatch.setattr(drives, "_table", lambda *of: "")
    for weights in ("one", "other"):
        monkeypatch.setattr(drives, "fingerprint", lambda _, weights=weights: weights)
        main(Settings(tmp_path, 1, count=2, scans=20))
    places = {kind: [folder for name, folder in done if name == kind] for kind, _ in done}
    for kind in ("drive", "evaluate-drive"):
        assert len(set(places[kind])) == len(places[kind])
    assert len(set(places["simulate"])) == 2


def test_the_table_has_each_street_their_spread_and_all_labels_as_one(tmp_path):
    """And every commit that found a part of it, with its changes."""

    def written(path, record):
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(record), "utf-8")

    shares = {"1": (0.9, 0.8, 0.7, 0.6), "2": (0.8, 0.6, 0.5, 0.2), "1-2": (0.83, 0.65, 0.55, 0.3)}
    for name, found in shares.items():
        marks = [{"average_precision": one, "recall_at_90": one - 0.1} for one in found]
        ours = {"labels": 100, "detections": marks}
        ours["purity"] = {"tracks_per_vehicle": 1.1, "impure_tracks": 0}
        ways = [{"drift_percent": 0.2 * int(name[0])}]
        record = {"methods": {"wildshape": ours}, "trajectories": ways}
        written(tmp_path / "evaluation" / name / "metrics.json", record)
    for seed, code in (("1", "a" * 40), ("2", f"{'b' * 40} with changes")):
        said = {"provenance": {"code": code}, "result": {"seconds": {"tracks": 2, "merging": 4}}}
        written(tmp_path / "found" / seed / "wildshape.json", said)
    lines = drives._table(tmp_path, ["1", "2"], "1-2", scans=20).splitlines()
    assert lines[2] == "| 1 | 100 | 90.0 | 80.0 | 70.0 | 60.0 | 80.0 | 1.10 | 0 | 0.20 | 3.0 |"
    assert lines[4] == "| mean | 100 | 85.0 | 70.0 | 60.0 | 40.0 | 75.0 | 1.10 | 0 | 0.30 | 3.0 |"
    assert lines[5] == "| deviation | 0 | 7.1 | 14.1 | 14.1 | 28.3 | 7.1 | 0.00 | 0 | 0.14 | 0.0 |"
    assert lines[6] == "| all as one | 100 | 83.0 | 65.0 | 55.0 | 30.0 | 73.0 | 1.10 | 0 |  |  |"
    assert lines[-3] == "Seconds a second of drive, mean, by stage: tracks 1.00, merging 2.00."
    assert lines[-1] == "Found at commit aaaaaaa, bbbbbbb with changes."
