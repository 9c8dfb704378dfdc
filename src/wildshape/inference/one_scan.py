# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is said of one scan of a batch: its complete shape, box, pose, and how far to trust them."""

import torch

from wildshape.geometry.transforms.se3 import stack
from wildshape.inference.boxes import box_seen
from wildshape.inference.choose_hypothesis import Looked, Posed
from wildshape.inference.confidence import glance_of, judged
from wildshape.inference.config import InferenceConfig
from wildshape.inference.densify import with_its_scan
from wildshape.inference.free_space import without_free_space
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.trust_features import scan_features
from wildshape.records import Completion, Sensor


def completion_of(
    looked: Looked,
    i: int,
    posed: Posed,
    sensor: Sensor | None,
    settings: ModelSettings,
    config: InferenceConfig,
    *,
    refined: bool,
) -> Completion:
    """Scan `i` of those looked at.

    Args:
        looked: scans, and what the network says of them.
        i: which.
        posed: what was made of them all.
        sensor: how they were taken; None: as those trained on.
        settings: of the weights.
        config: see there.
        refined: whether `posed` was fitted to the scans.
    """
    scan, seen, found, sights = looked.scans[i], looked.seen[i], looked.found, looked.sights
    shape, T_sensor_can, points = posed.shapes[i], posed.T_sensor_canonical[i], posed.points[i]
    said = glance_of(scan, sensor, *found.said(i), settings, config.reasons)
    exact = settings.sensor == "camera"
    whole, solid, standing = points.numpy(), shape, None
    if sights is not None:
        alone = sights.part([i])
        solid = without_free_space(shape, stack([T_sensor_can]), alone)
        standing = alone.of(whole, 0)
    box = box_seen(
        solid,
        T_sensor_can,
        seen,
        mirror=settings.network.mirror,
        body=not exact,
        unit=settings.unit,
        config=config.box,
    )
    done = Completion(
        points=with_its_scan(whole, shape, seen, T_sensor_can, settings, config.refine),
        pose=T_sensor_can.to(torch.float64).owned(),
        box=box,
        confidence=said.confidence,
        branch=said.branch,
        cost=float(found.cost[i]),
        refined=refined,
        warning=said.warning,
        reasons=said.reasons,
        features=said.features,
    )
    if not refined or exact:
        return judged(done, None, None, settings, config.reasons)
    rival, trust = float(found.features[i, -1]), settings.trust
    evidence = scan_features(done, seen, posed.surfaces[i], rival, standing)
    return judged(done, trust and trust.scan, evidence, settings, config.reasons)
