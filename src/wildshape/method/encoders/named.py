# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The encoders by name: any point network can be the encoder (paper, section 4.2).

Imports no torch, so that the command line can offer the names.
"""

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from torch import nn

Backbone = Literal["pcn", "pointnet2", "dgcnn"]


def encoder_of(
    name: Backbone,
    widths: tuple[int, int, int, int],
    *,
    neighbours: int,
    centres: tuple[int, int],
) -> "nn.Module":
    """A module from `(B, n, 3)` points to `(B, z)` codes, z the last of the widths.

    Args:
        name: of the encoder.
        widths: of its layers.
        neighbours: of a point, where it looks at neighbourhoods.
        centres: of neighbourhoods in two levels, where it has them.
    """
    match name:
        case "pcn":
            from wildshape.method.encoders.pcn import PCNEncoder

            return PCNEncoder(widths)
        case "pointnet2":
            from wildshape.method.encoders.pointnet2 import PointNet2Encoder

            return PointNet2Encoder(widths, centres, neighbours)
        case "dgcnn":
            from wildshape.method.encoders.dgcnn import DGCNNEncoder

            return DGCNNEncoder(widths, neighbours)
