# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scan to feature: PCN's encoder, its faster twins, and two others.

Start with `pcn`.
"""
