# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Drives measured: what another call left is neither pooled nor taken for one's own."""

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
