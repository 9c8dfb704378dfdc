# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From tracks to vehicles: whole shapes, which tracks are one object, which are none, boxes.

Start with `completion`. Scans are cut out in `tracking`, files are written in `writing`.
"""
