# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms, projections, boxes, surfaces: plain mathematics on tensors.

No files, no networks, no records. Start with `transforms.se3`.
"""
