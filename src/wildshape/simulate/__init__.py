# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated tracks and drives: sensors, objects, drive-bys, streets, ray casting.

Start with `generate`; what can be set is in `config`.
"""
