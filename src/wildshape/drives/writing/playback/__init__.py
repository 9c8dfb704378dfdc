# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A finished drive as a recording for other viewers: MCAP for Foxglove, RRD for Rerun.

Start with `moments`: what is where at which time. A module a format.
"""
