# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""nuScenes and its relatives: tables in JSON, sweeps of LiDARs.

Start with `reader`.
"""
