# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper (Gu et al., ECCV 2020): encoders, decoders, network, equations 2 to 5, checkpoint.

What a checkpoint holds beyond it is here, too: `ray_encoder`, `confidence`, `trust`. Start with
`network`.
"""
