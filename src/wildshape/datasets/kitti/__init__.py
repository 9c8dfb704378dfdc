# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI raw (tracklets) and KITTI tracking (labels), with their calibration and GPS/IMU poses.

Start with `raw`.
"""
