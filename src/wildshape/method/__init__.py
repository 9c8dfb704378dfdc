# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper (Gu et al., ECCV 2020): encoders, decoders, network, equations 2 to 5, checkpoint.

What goes beyond it is in `training`, `inference` and `baselines`. Start with `network`.
"""
