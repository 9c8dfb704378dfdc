# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recipes, the loop, its state and logs.

Batches are in `batches`, pseudo-labels in `self_training`, what a machine needs in `runtime`. What
the command does is in `train`.
Start with `loop`.
"""
