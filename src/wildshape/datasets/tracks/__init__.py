# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From frames to tracks, the same for every data set: selection, crops, gathering, truth.

Start with `source`, what every reader offers.
"""
