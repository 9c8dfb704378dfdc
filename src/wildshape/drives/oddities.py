# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a recording lacks for results that can be believed, a sentence each."""

import filecmp
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from wildshape.drives.config import LinkConfig
from wildshape.drives.source import Drive
from wildshape.io.progress import counted

_SLOW_S = 0.21  # 5 Hz is well enough
_FEWEST_SCANS = 5
_LEAST_BYTES = 2000  # of a file; smaller ones hold hardly any points, and may be alike


def copies_told(files: Sequence[Path]) -> list[str]:
    """A sentence if scans are exact copies of the ones before, as of a sensor that hangs.

    Files of one size are read as far as they are alike.

    Args:
        files: one a scan.
    """
    copies = [
        frame
        for frame, (before, after) in enumerate(pairwise(files), 1)
        if after.stat().st_size > _LEAST_BYTES and filecmp.cmp(before, after, shallow=False)
    ]
    if not copies:
        return []
    return [
        f"{counted(len(copies), 'scan')} the same to the last bit as the one before, the first:"
        f" frame {copies[0]}"
    ]


def count_told(scans: int) -> list[str]:
    """A sentence if scans are too few to tell; `scans`: those with points."""
    if scans >= _FEWEST_SCANS:
        return []
    return [f"{counted(scans, 'scan')} with points: too few to tell which vehicles move"]


def rate_told(drive: Drive, config: LinkConfig) -> list[str]:
    """A sentence where scans are so far apart in time that fast vehicles are lost."""
    if drive.scan_s is None or drive.scan_s < _SLOW_S:
        return []
    fastest = config.every(drive.scan_s).fastest
    return [
        f"at {1 / drive.scan_s:.2g} scans a second fast vehicles are often lost, those above"
        f" {fastest:.0f} m/s always"
    ]
