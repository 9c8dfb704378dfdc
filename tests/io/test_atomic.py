# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import errno
import json
import os
import stat
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from wildshape.io.atomic import atomic_write, write_json, write_text


def test_nothing_under_the_name_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.bin"
    with atomic_write(path) as file:
        file.write(b"half")
        assert not path.exists()
    assert path.read_bytes() == b"half"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OSError])
def test_an_error_leaves_the_old_file_and_nothing_else(error, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")

    def fail() -> None:
        with atomic_write(path) as file:
            file.write(b"new")
            raise error

    with pytest.raises(error):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_only_what_is_asked_for_is_flushed_and_before_it_has_its_name(tmp_path, monkeypatch):
    named: list[bool] = []
    monkeypatch.setattr(os, "fsync", lambda _: named.append((tmp_path / "long").exists()))
    write_text(tmp_path / "short", "soon made again")
    write_json(tmp_path / "long", {}, flush=True)
    assert named == [False]


def test_permissions_are_those_of_an_ordinary_file(tmp_path: Path) -> None:
    write_text(tmp_path / "a", "")
    (tmp_path / "b").write_text("")
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in "ab"}
    assert len(modes) == 1


def test_json_is_real_json(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"a": [1, 2.5, None]})
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": [1, 2.5, None]}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "b.json", {"a": float("nan")})
    assert not (tmp_path / "b.json").exists()


def test_the_longest_name_can_be_written(tmp_path: Path) -> None:
    longest = tmp_path / ("n" * 255)
    write_text(longest, "whole")
    assert longest.read_text() == "whole"


@pytest.mark.parametrize("name", ["n" * 256, "n" * 300 + ".json"])
def test_a_name_that_is_too_long_is_named_before_anything_is_written(name, tmp_path: Path) -> None:
    def write() -> None:
        with atomic_write(tmp_path / name):
            written.append(1)

    written = []
    with pytest.raises(OSError, match="too long") as refused:
        write()
    assert refused.value.filename == str(tmp_path / name)
    assert ".part" not in str(refused.value)
    assert written == []
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "taken" / "by").mkdir(parents=True)
    with pytest.raises(OSError, match="taken") as refused:
        write_text(tmp_path / "taken", "")
    assert str(refused.value).endswith(f"'{tmp_path / 'taken'}'")
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]


def test_a_full_disk_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space left") as full, atomic_write(tmp_path / "a"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert full.value.filename == str(tmp_path / "a")


def test_names_that_are_no_utf8_are_spelt_out(tmp_path: Path) -> None:
    write_text(tmp_path / "a.html", "caf\udce9")
    assert (tmp_path / "a.html").read_text("utf-8") == "caf\\udce9"


def test_threads_that_write_at_once_leave_the_umask_as_it_was(tmp_path: Path) -> None:
    before, often = os.umask(0o077), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # else threads hardly ever meet
    try:
        with ThreadPoolExecutor(8) as threads:
            list(threads.map(lambda i: write_text(tmp_path / str(i), ""), range(200)))
        after = os.umask(0o077)
    finally:
        os.umask(before)
        sys.setswitchinterval(often)
    assert after == 0o077
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()} == {0o600}
