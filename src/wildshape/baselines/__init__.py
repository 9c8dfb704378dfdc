# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What Wildshape is compared with: ICP, features and robust solvers, DPC.

`pairs` makes a method of what registers two scans; `compare` measures models and baselines beside
each other. Start with `named`.
"""
