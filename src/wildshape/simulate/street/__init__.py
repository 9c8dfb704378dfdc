# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whole simulated drives: a street with traffic, scanned all around while driving through it.

Single objects are `simulate/generate`. Start with `whole_drive`.
"""
