# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a recording lacks for results that can be believed, a sentence each."""

from wildshape.drives.config import LinkConfig
from wildshape.drives.source import Drive

_SLOW_S = 0.21  # 5 Hz is well enough


def rate_told(drive: Drive, config: LinkConfig) -> list[str]:
    """A sentence where scans are so far apart in time that fast vehicles are lost."""
    if drive.scan_s is None or drive.scan_s < _SLOW_S:
        return []
    fastest = config.every(drive.scan_s).fastest
    return [
        f"at {1 / drive.scan_s:.2g} scans a second fast vehicles are often lost, those above"
        f" {fastest:.0f} m/s always"
    ]
