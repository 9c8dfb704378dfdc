# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of a run: kept up to the step it goes on from, and never the reason that it hangs."""

import errno
import json
import threading

import pytest
from tensorboardX.proto.event_pb2 import Event  # pyright: ignore[reportAttributeAccessIssue]
from tensorboardX.record_writer import RecordWriter
from tests.disk import full_disk

from wildshape.training.runtime.log import RunLog


def events(folder):
    """All TensorBoard events of a run: records of length, its check, data, its check."""
    found = []
    for file in sorted((folder / "tensorboard").iterdir()):
        data = file.read_bytes()
        while data:
            size = int.from_bytes(data[:8], "little")
            found.append(Event.FromString(data[12 : 12 + size]))
            data = data[16 + size :]
    return found


def test_numbers_go_to_both_files(tmp_path):
    with RunLog(tmp_path, 0) as log:
        log.write(25, {"loss": 0.5, "branch_shares": [0.25, 0.75], "validation/cd": 2})
    assert json.loads((tmp_path / "log.jsonl").read_text())["loss"] == 0.5
    drawn = {v.tag: (e.step, v.simple_value) for e in events(tmp_path) for v in e.summary.value}
    assert drawn == {"loss": (25, 0.5), "validation/cd": (25, 2.0)}


def test_later_entries_and_a_torn_last_line_are_dropped(tmp_path):
    (tmp_path / "log.jsonl").write_text('{"step": 25}\n{"step": 50}\n{"step": 7')
    with RunLog(tmp_path, 30) as log:
        log.write(40, {})
    rows = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows] == [25, 40]
    assert 31 in [e.step for e in events(tmp_path) if e.HasField("session_log")]


def test_a_full_disk_is_an_error_and_no_wait(tmp_path, monkeypatch):
    """Written by a thread of its own, events filled a queue when that thread had died."""

    def full(self, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    before = threading.active_count()
    with RunLog(tmp_path, 0) as log:
        assert threading.active_count() == before
        monkeypatch.setattr(RecordWriter, "write", full)
        with pytest.raises(OSError, match="No space"):
            log.write(25, {"loss": 0.5})


def test_only_whole_entries_are_kept(tmp_path):
    whole, later = b'{"step": 3, "loss": 0.5}\n', b'{"step": 9, "loss": 0.1}\n'
    damaged = b'\xff\xfe\n7\n{}\n{"step": null}\n{"step": [1]}\n' + b"[" * 99_999 + b"\n"
    (tmp_path / "log.jsonl").write_bytes(whole + damaged + later)
    with RunLog(tmp_path, 5):
        pass
    assert (tmp_path / "log.jsonl").read_bytes() == whole


def test_a_full_disk_names_the_log(tmp_path):
    with full_disk(5_000, tmp_path / "log.jsonl"), RunLog(tmp_path, 0) as log:
        log.write(1, {"note": "x" * 10_000})
