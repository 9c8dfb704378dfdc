# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of many scans in the formats of other projects, written and read back.

Start with `detections`.
"""
