# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files of frames by their numbers."""

from tests.refusal import refused

from wildshape.datasets.tracks.parts import numbered


def test_files_come_by_number_and_others_are_passed_over(tmp_path):
    for name in ("10.bin", "9.bin", "7.txt", "a.bin", "._8.bin", "².bin"):
        (tmp_path / name).touch()
    assert list(numbered(tmp_path, ".bin", "").items()) == [
        (9, tmp_path / "9.bin"),
        (10, tmp_path / "10.bin"),
    ]
    refused(
        numbered, tmp_path / "no", ".bin", "no scans; copy it", match=r"no: no scans; copy it\.$"
    )
