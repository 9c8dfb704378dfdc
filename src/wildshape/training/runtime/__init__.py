# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a run needs of its machine: processes, CUDA graphs, logs, profiles.

Start with `torchrun`.
"""
