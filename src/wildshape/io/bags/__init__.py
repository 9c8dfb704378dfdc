# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of ROS: bags of ROS 1, and ROS 2 in SQLite or MCAP. Start with `reader`."""
