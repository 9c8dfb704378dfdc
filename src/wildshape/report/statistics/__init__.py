# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What tracks hold, in numbers whose memory does not grow with the data, and drawn on a sheet.

Start with `statistics`.
"""
