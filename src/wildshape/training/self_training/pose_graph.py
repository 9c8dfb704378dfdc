# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The poses of a track's scans as a graph: scan to scan by local registration, held by the network.

Beyond the paper. Scans that follow each other see nearly the same side of the object, and GICP lays
one on the other to a centimetre where the network poses each to a decimetre; chained, it drifts.
The scans after the next are laid on, too, and each scan's own pose is a weak prior. Robust least
squares over all poses at once then leave out the registrations that went wrong. Costs grow with the
number of scans and not with its square. No label is used.

What all scans of a track get wrong together, this takes out, where scans drawn to the mean of all
(`joint_icp.py`) do not: a network that believes in shorter cars places the scans of a front and
those of a rear too near to each other, and along a smooth side nothing holds them apart but a chain
of neighbours that each saw a little more of it.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.geometry.sampling import voxel_thin
from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points

_TINY = 1e-12


@dataclass(frozen=True)
class PoseGraphConfig:
    """Which scans are laid on each other, and how far that is believed. Lengths are for vehicles.

    Attributes:
        steps: a scan is laid on those so many places further on.
        passes: registrations, each from the poses that the one before it gave.
        voxel_m: scans are thinned to this.
        reach_m: points further apart are no pair.
        neighbours: points that a point's covariance is taken from.
        fewest: thinned scans of fewer points are not laid on others.
        edge_deg: how far off a registration's rotation is taken to be.
        edge_m: the same of its translation.
        prior_deg: how far off a pose given is taken to be.
        prior_m: the same of its translation; so weak that a chain of neighbours can move it.
        widest: width of the robust kernels at first, standard deviations; nothing is left out yet.
        narrower: they narrow by this factor a round.
        narrowest: at last.
        rounds: Gauss-Newton steps.
    """

    steps: tuple[int, ...] = (1, 2, 3)
    passes: int = 2
    voxel_m: float = 0.1
    reach_m: float = 0.3
    neighbours: int = 20
    fewest: int = 16
    edge_deg: float = 0.5
    edge_m: float = 0.03
    prior_deg: float = 5.0
    prior_m: float = 0.5
    widest: float = 40.0
    narrower: float = 0.7
    narrowest: float = 3.0
    rounds: int = 15

    @property
    def edge(self) -> Float[Tensor, "6"]:
        """Weight of a registration's rotation and translation."""
        return _weight(self.edge_deg, self.edge_m)

    @property
    def prior(self) -> Float[Tensor, "6"]:
        """Weight of the rotation and translation of a pose given."""
        return _weight(self.prior_deg, self.prior_m)


_DEFAULT = PoseGraphConfig()


class Edges(NamedTuple):
    """Registrations of pairs of scans.

    Attributes:
        source: number of a scan.
        target: number of the scan that it was laid on.
        T_target_source: found.
    """

    source: Int64[Tensor, "E"]
    target: Int64[Tensor, "E"]
    T_target_source: SE3


@torch.no_grad()
def refine_by_graph(
    scans: list[Points], T_sensor_object: SE3, config: PoseGraphConfig = _DEFAULT
) -> SE3:
    """Poses near the given ones under which the scans fit their neighbours.

    Args:
        scans: of one rigid object, in time order, sensor frames, metres. Neither the sensor nor the
            object need stand still: scan i is laid on scan j as an object, not as a place.
        T_sensor_object: one pose a scan, good to about a decimetre and some degrees.
        config: what is laid on what.
    """
    found = T_sensor_object.to(torch.float64)
    clouds = [_prepared(scan, config) for scan in scans]
    for _ in range(config.passes):
        edges = register_pairs(clouds, found, config)
        if edges is None:
            return T_sensor_object
        found = solve(found, edges, config)
    return found.to(T_sensor_object.rotation.dtype)


def register_pairs(
    clouds: list[Any], T_sensor_object: SE3, config: PoseGraphConfig
) -> Edges | None:
    """Each scan, `_prepared`, laid on the next few, by GICP from the given poses."""
    pairs = [(i, i + step) for step in config.steps for i in range(len(clouds) - step)]
    pairs = [pair for pair in pairs if clouds[pair[0]] and clouds[pair[1]]]
    if not pairs:
        return None
    found = [
        _laid_on(
            clouds[i], clouds[j], T_sensor_object[j] @ T_sensor_object[i].inverse(), config.reach_m
        )
        for i, j in pairs
    ]
    matrix = torch.from_numpy(np.stack(found))
    source, target = torch.tensor(pairs).unbind(-1)
    return Edges(source, target, SE3(matrix[:, :3, :3], matrix[:, :3, 3]))


def _prepared(scan: Points, config: PoseGraphConfig) -> Any:
    """A scan as small_gicp wants it, cloud and tree; None if there is too little of it."""
    import small_gicp

    thinned = voxel_thin(scan, config.voxel_m)
    if len(thinned) < config.fewest:
        return None
    cloud = small_gicp.PointCloud(thinned.astype(np.float64))
    tree = small_gicp.KdTree(cloud, num_threads=1)
    near = min(config.neighbours, len(thinned))
    small_gicp.estimate_covariances(cloud, tree, near, num_threads=1)
    return cloud, tree


def _laid_on(source: Any, target: Any, start: SE3, reach_m: float) -> Float[np.ndarray, "4 4"]:
    import small_gicp

    result = small_gicp.align(
        target[0],
        source[0],
        target[1],
        init_T_target_source=start.matrix.numpy(),
        registration_type="GICP",
        max_correspondence_distance=reach_m,
        num_threads=1,
    )
    return np.array(result.T_target_source)


def solve(T_sensor_object: SE3, edges: Edges, config: PoseGraphConfig = _DEFAULT) -> SE3:
    """Poses that agree best with the edges and with those given, by robust Gauss-Newton.

    The robust kernel narrows round by round, so that no registration is left out for an error of
    the poses. Poses are changed in the object's frame, about its own origin, where a degree is
    centimetres and not metres.
    """
    prior = T_sensor_object.inverse()
    pose, (i, j) = prior, (edges.source, edges.target)
    for step in range(config.rounds):
        kernel = max(config.widest * config.narrower**step, config.narrowest)
        between = _twist(pose[j] @ edges.T_target_source @ pose[i].inverse()) * config.edge
        own = _twist(pose @ prior.inverse()) * config.prior
        pose = _moved(pose, _step(between, own, edges, kernel, config))
    return pose.inverse()


def _step(
    between: Float[Tensor, "E 6"],
    own: Float[Tensor, "V 6"],
    edges: Edges,
    kernel: float,
    config: PoseGraphConfig,
) -> Float[Tensor, "V 6"]:
    """The step of all poses; to first order a residual changes as its poses do."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    count = len(own)
    trust = (1 + between.square().sum(-1) / kernel**2) ** -2  # Geman-McClure: some are wrong
    doubt = (1 + own.square().sum(-1) / kernel**2) ** -1  # Cauchy: none is to be forgotten
    edge = trust[:, None] * config.edge
    hold = doubt[:, None] * config.prior
    right = -hold * own
    right = right.index_add(0, edges.target, -edge * between)
    right = right.index_add(0, edges.source, edge * between)
    stiff, held = edge * config.edge, hold * config.prior
    of = torch.arange(6 * count).view(count, 6)
    i, j = of[edges.source], of[edges.target]
    rows = torch.cat([part.reshape(-1) for part in (of, i, j, i, j)])
    columns = torch.cat([part.reshape(-1) for part in (of, i, j, j, i)])
    values = torch.cat([part.reshape(-1) for part in (held, stiff, stiff, -stiff, -stiff)])
    index, shape = (rows.numpy(), columns.numpy()), (6 * count, 6 * count)
    matrix = coo_matrix((values.numpy(), index), shape=shape).tocsc()
    return torch.from_numpy(np.asarray(spsolve(matrix, right.reshape(-1).numpy()))).view(count, 6)


def _weight(degrees: float, metres: float) -> Float[Tensor, "6"]:
    """One over the deviations of rotation and translation."""
    turn, shift = 1 / np.radians(degrees), 1 / metres
    return torch.tensor((turn,) * 3 + (shift,) * 3, dtype=torch.float64)


def _twist(T: SE3) -> Float[Tensor, "N 6"]:
    """Rotation vector, radians, and translation, metres."""
    q = quaternion_from_rotation(T.rotation)
    length = q[:, 1:].norm(dim=-1, keepdim=True)
    angle = 2 * torch.atan2(length, q[:, :1])
    vector = q[:, 1:] * torch.where(length < _TINY, 2.0, angle / length.clamp_min(_TINY))
    return torch.cat((vector, T.translation), dim=-1)


def _moved(pose: SE3, step: Float[Tensor, "V 6"]) -> SE3:
    x, y, z = step[:, :3].unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), -1).view(-1, 3, 3)
    return SE3(torch.linalg.matrix_exp(cross), step[:, 3:]) @ pose
