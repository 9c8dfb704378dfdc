# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Waymo Open Dataset, Perception v2: parquet tables and range images.

Start with `reader`.
"""
