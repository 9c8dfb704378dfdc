# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A scan that a network has looked at, completed on its own: refined, boxed, judged (METHOD 7)."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.densify import denser, partners
from wildshape.geometry.sampling import sorted_points
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.boxes import box_seen
from wildshape.inference.confidence import glance_of, judged
from wildshape.inference.config import InferenceConfig, RefineConfig
from wildshape.inference.free_space import without_free_space
from wildshape.inference.looks import Found, Looked
from wildshape.inference.refine import Refined, refine, with_its_scan
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.trust import Surface
from wildshape.method.trust_features import scan_features, surfaces
from wildshape.records import Completion, Sensor


class Posed(NamedTuple):
    """What is made of a batch of scans.

    Attributes:
        shapes: the network's points, canonical frame.
        T_sensor_canonical: their poses.
        points: of the complete shapes, sensor frames, those of `shapes` first.
        refined: whether they were fitted to the scans.
        surfaces: of a LiDAR's scans, where refined; what is trusted is told by them.
    """

    shapes: Float[Tensor, "B P 3"]
    T_sensor_canonical: SE3
    points: Float[Tensor, "B Q 3"]
    refined: bool = False
    surfaces: Sequence[Surface] = ()

    @classmethod
    def of(cls, found: Found) -> "Posed":
        """As the network says."""
        T_sensor_canonical = SE3(found.rotation, found.translation)
        return cls(found.shapes, T_sensor_canonical, T_sensor_canonical.apply(found.shapes))


def refined(
    looked: Looked,
    up: Float[Tensor, "3"] | None,
    settings: ModelSettings,
    config: RefineConfig,
    device: torch.device,
    *,
    dense: bool,
) -> Posed:
    """Shapes and poses fitted to the scans on a device (`refine.py`); `up` as there."""
    seen, found = [sorted_points(one) for one in looked.seen], looked.found
    on_device = (part.to(device) for part in found[:3])
    up = None if up is None else up.to(device)
    done = refine(seen, *on_device, mirror=settings.network.mirror, up=up, config=config)
    done = Refined(*(part.cpu() for part in done))
    T_sensor_canonical = SE3(done.rotation, done.translation)
    posed = T_sensor_canonical.to(torch.float32).apply(done.shapes)
    shown = surfaces(seen, done.rotation) if settings.sensor == "lidar" else ()
    points = denser(posed, partners(found.shapes, config.partner)) if dense else posed
    return Posed(done.shapes, T_sensor_canonical, points, True, shown)


def completed(
    looked: Looked,
    i: int,
    posed: Posed,
    sensor: Sensor | None,
    settings: ModelSettings,
    config: InferenceConfig,
) -> Completion:
    """Scan `i` of those looked at."""
    scan, seen, found, sights = looked.scans[i], looked.seen[i], looked.found, looked.sights
    said = glance_of(scan, sensor, *found.said(i), settings, config.reasons)
    shape, T_sensor_can, points = posed.shapes[i], posed.T_sensor_canonical[i], posed.points[i]
    whole, solid, standing = points.numpy(), shape, None
    shows = with_its_scan(whole, shape, seen, T_sensor_can, settings, config.refine)
    if sights is not None:
        alone = sights.part([i])
        solid = without_free_space(shape, stack([T_sensor_can]), alone)
        standing = alone.of(whole, 0)
    done = Completion(
        points=shows,
        pose=T_sensor_can.to(torch.float64).owned(),
        box=box_seen(solid, T_sensor_can, seen, settings, config.box),
        confidence=said.confidence,
        branch=said.branch,
        cost=said.cost,
        refined=posed.refined,
        warning=said.warning,
        reasons=said.reasons,
        features=said.features,
    )
    if not posed.surfaces:
        return judged(done, None, None, settings, config.reasons)
    rival = float(found.features[i, -1])
    evidence = scan_features(done, seen, posed.surfaces[i], rival, standing)
    trust = settings.trust
    return judged(done, trust and trust.scan, evidence, settings, config.reasons)
