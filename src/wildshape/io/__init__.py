# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files: scans by suffix, track folders, the packed store, boxes, bags, packets.

Formats of published data sets are in `datasets`. Start with `tracks`, or `scans.points`.
"""
