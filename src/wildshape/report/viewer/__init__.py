# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The interactive page: tracks over time, their completed shapes, boxes, poses and truth.

Start with `page`; `drive_page` is that of a drive.
"""
