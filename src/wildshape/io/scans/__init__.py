# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scan files by suffix, read behind checks and written; meshes written.

A reader returns points and decides nothing else. Start with `points`, the door.
"""
