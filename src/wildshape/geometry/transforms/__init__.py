# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rotations and rigid transforms, between them and along a trajectory.

Start with `se3`: `T_a_b` takes points of frame b to frame a.
"""
