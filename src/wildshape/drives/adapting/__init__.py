# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The model trains on the vehicles that it found, without labels, and is kept only if better.

Start with `adapt`. What a drive is completed by a second time is put in place by `second_pass`.
"""
