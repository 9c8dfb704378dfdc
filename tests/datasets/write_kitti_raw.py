# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive in KITTI raw's layout."""

import math

import numpy as np
import torch
from tests.cars import poses_of, shape_of

from wildshape.simulate.generate import SimulationConfig, simulate_tracks

SIZE = (4.0, 1.8, 1.5)  # l w h


def pose_xml(tx, ty, tz, rz):
    fields = {"tx": tx, "ty": ty, "tz": tz, "rx": 0, "ry": 0, "rz": rz}
    return "<item>" + "".join(f"<{k}>{v}</{k}>" for k, v in fields.items()) + "</item>"


def tracklet_xml(category, first_frame, poses, size=SIZE):
    length, width, height = size
    return (
        f"<item><objectType>{category}</objectType><h>{height}</h><w>{width}</w><l>{length}</l>"
        f"<first_frame>{first_frame}</first_frame><poses><count>{len(poses)}</count>"
        f"<item_version>2</item_version>{''.join(pose_xml(*p) for p in poses)}</poses></item>"
    )


def write_drive(folder, tracklets, clouds, scans="velodyne_points/data"):
    folder.mkdir(parents=True, exist_ok=True)
    body = "".join(tracklet_xml(*tracklet) for tracklet in tracklets)
    (folder / "tracklet_labels.xml").write_text(
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?><!DOCTYPE boost_serialization>'
        f"<boost_serialization><tracklets><count>{len(tracklets)}</count>{body}</tracklets>"
        "</boost_serialization>"
    )
    (folder / scans).mkdir(parents=True, exist_ok=True)
    for frame, cloud in clouds.items():
        rows = np.concatenate((cloud, np.zeros((len(cloud), 1))), axis=1)
        rows.astype("<f4").tofile(folder / scans / f"{frame:010d}.bin")
    return folder


def in_velo(points, pose):
    """By hand: turn about z, then from the box's floor centre."""
    x, y, z, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    p = np.atleast_2d(points)
    turned = np.stack((c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1], p[:, 2]), axis=1)
    return turned + np.array((x, y, z))


def picture_scene(root):
    """A simulated car, passed; what the documentation shows."""
    config = SimulationConfig(tracks=1, scans=11, occlusion=0.0)
    (track,) = simulate_tracks(config, seed=1, workers=1)
    low, high = shape_of(track).min(axis=0), shape_of(track).max(axis=0)
    labels = []
    for i in range(len(track.scans)):
        T = poses_of(track)[i]
        yaw = math.atan2(float(T.rotation[1, 0]), float(T.rotation[0, 0]))
        labels.append((*(T.translation - torch.tensor([0, 0, (high - low)[2] / 2])).tolist(), yaw))
    tracklet = ("Car", 0, labels, (high - low).tolist())
    clouds = dict(enumerate(track.scans))
    write_drive(root / "2011_09_26" / "2011_09_26_drive_0099_sync", [tracklet], clouds)
