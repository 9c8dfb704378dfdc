# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `train` and `demo` share, and the training of DPC.

Start with `recipe`.
"""
