# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From full scans to tracks of clusters, in the stages' order. Shapes are not known here.

Start with `segmentation`: what is ground in a scan, and what stands on it.
"""
