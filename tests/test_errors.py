# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Messages, whatever a damaged file puts into them."""

from pathlib import Path

import pytest

from wildshape.errors import BadInputError
from wildshape.io.scans.points import read_points
from wildshape.io.tracks import NoUsableScanError


def test_what_a_file_says_cannot_steer_the_terminal(tmp_path):
    path = tmp_path / "scan.ply"
    path.write_bytes(b"ply\nformat \x1b[2J 1.0\nend_header\n")
    with pytest.raises(BadInputError, match=r"'\\x1b\[2J' is unknown"):
        read_points(path)


def test_a_name_that_is_no_utf8_can_be_printed():
    found = str(NoUsableScanError(Path("car\udcff"), ()))
    assert found.encode().startswith(b"car\\udcff: none of 0 scans")


def test_the_middle_of_a_very_long_message_is_left_out():
    found = str(BadInputError("scan.ply: " + 5000 * "x" + "; write the file again."))
    assert len(found) < 1600
    assert found.startswith("scan.ply: xxx")
    assert found.endswith("xxx; write the file again.")
