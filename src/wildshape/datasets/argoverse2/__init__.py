# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Argoverse 2 (sensor): labelled boxes and LiDAR sweeps in feather files.

Start with `reader`.
"""
