# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What was found in whole drives against labels: detection, tracking, sizes, trajectory.

Single objects are measured by `evaluation/protocol`. Start with `protocol` here.
"""
