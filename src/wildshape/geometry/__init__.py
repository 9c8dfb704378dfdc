# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms, projections, centring, boxes: plain mathematics on tensors."""
