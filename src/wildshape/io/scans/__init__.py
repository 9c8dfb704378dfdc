# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scan files by suffix, read behind checks and written; meshes written.

A reader returns points and decides nothing else. Start with `points`, the door:

- `read_scan(path, coordinates)`: the scan of one object, `ScanFile`; another size is refused.
- `read_points(path, coordinates)`: any scan, a full turn of 100,000 points too, `(n, 3)` float32.
- `turns.read_turn(path, time)`: such a turn with the times of its points.

Both give metres in the sensor's frame; `Coordinates(unit, origin)` says what the file has.
"""
