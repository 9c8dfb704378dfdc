# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Several drives at once are the drives one by one."""

import pytest
from tests.drives.street import street, write_scans
from tests.io.test_atomic_lock import held

from wildshape.drives.result import REPORT, DriveResult
from wildshape.errors import BadInputError
from wildshape.inference.predictor import load
from wildshape.report.drive import many
from wildshape.report.drive.many import DriveAndPage, drive_many

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")


def test_several_drives_at_once(tmp_path, request):
    scans = street().scans
    thin = [scan[::40] for scan in scans[:3]]
    for name, part in {"monday": scans[:5], "tuesday": thin, "friday": thin}.items():
        write_scans(tmp_path / name, part)
    (tmp_path / "friday" / "times.txt").write_text("0.1\n0.0\n0.2\n")
    folders = {tmp_path / name: tmp_path / "out" / name for name in ("tuesday", "friday", "monday")}
    task = DriveAndPage(load())
    alone = DriveAndPage(task.predictor, workers=1, report=False).find(
        tmp_path / "monday", tmp_path / "m"
    )
    request.getfixturevalue("only_helpers")
    found = drive_many(task, folders, workers=2)
    assert [one.out.name for one in found.found] == ["tuesday", "monday"]
    assert [one.frames for one in found.found] == [3, 5]
    assert (list(found.refused), found.workers) == ([tmp_path / "friday"], 2)
    assert "time 2 (0) is not after" in found.refused[tmp_path / "friday"]
    for name in ("boxes.csv", "trajectory.txt", "stages/tracks.json"):
        there = tmp_path / "out" / "monday" / name
        assert there.read_bytes() == (alone.out / name).read_bytes(), name
    assert (tmp_path / "out" / "monday" / REPORT).is_file()


def test_a_drive_is_claimed_until_its_report_is_written(tmp_path, monkeypatch):
    scans, out = tmp_path / "scans", tmp_path / "out"
    write_scans(scans, [scan[::40] for scan in street().scans[:3]])
    claimed = []

    def report(*_):
        with pytest.raises(AssertionError), held(out):
            pass
        claimed.append(out)

    monkeypatch.setattr(many, "write_drive_report", report)
    DriveAndPage(load(), workers=1).find(scans, out)
    assert claimed == [out]
    with held(out):
        pass


def test_a_drive_of_many_is_left_to_other_workers(tmp_path):
    """With --adapt there is a second pass: the worker of the first kept the folder to itself."""
    scans, out = tmp_path / "scans", tmp_path / "out"
    write_scans(scans, [scan[::40] for scan in street().scans[:3]])
    task = DriveAndPage(load(), workers=1, report=False)
    refused, found = task((tmp_path, out))[1], task((scans, out))[1]
    assert isinstance(refused, BadInputError)
    assert isinstance(found, DriveResult)
    with held(out):
        pass
