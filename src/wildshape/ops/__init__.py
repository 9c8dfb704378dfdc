# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tensor operations with one door each and interchangeable backends behind it.

No scans, no poses, no files: tensors in, tensors out. Start with `nearest`.
"""
