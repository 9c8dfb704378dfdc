# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What Wildshape is compared with: ICP, features and robust solvers, DPC.

Start with `named`.
"""
