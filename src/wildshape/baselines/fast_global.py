# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""FPFH and fast global registration (Zhou et al., ECCV 2016) by Open3D, as in the paper."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from wildshape.baselines.pairs import about_centroids
from wildshape.geometry.other_libraries import load_open3d
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor


@dataclass(frozen=True)
class FastGlobal:
    """A coarse alignment of a pair, with no start.

    Normals are turned towards the sensor, which stands at the origin: without that FPFH cannot
    tell one side of a car from the other.

    Attributes:
        voxel: edge of the cubes the clouds are thinned by, metres; lengths below are in voxels.
        normal_radius: of a normal's neighbourhood.
        normal_points: of it, at most.
        feature_radius: of a feature's neighbourhood.
        feature_points: of it, at most.
        distance: correspondences further apart are ignored.
    """

    voxel: float = 0.125
    normal_radius: float = 2.0
    normal_points: int = 30
    feature_radius: float = 5.0
    feature_points: int = 100
    distance: float = 0.5

    def __post_init__(self) -> None:
        """Refuse at once what could not run later.

        Raises:
            MissingExtraError: Open3D is not installed or does not load.
        """
        load_open3d()

    @property
    def engine(self) -> str:
        """The library."""
        return f"Open3D {load_open3d().__version__}"

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:  # noqa: ARG002
        """`T_target_source`; centroids aligned, no rotation, where nothing matches."""
        library = load_open3d()
        registration = library.pipelines.registration
        library.utility.random.seed(0)
        a, b = (self._features(library, points) for points in (source, target))
        option = registration.FastGlobalRegistrationOption(
            maximum_correspondence_distance=self.distance * self.voxel
        )
        try:
            found = registration.registration_fgr_based_on_feature_matching(
                a[0], b[0], a[1], b[1], option
            )
            return SE3.from_matrix(np.array(found.transformation))
        except (RuntimeError, ValueError):
            # Too few points for features: Open3D's own refusal, or a matrix that is no rotation.
            return about_centroids(source, target, lambda *_: SE3.identity())

    def _features(self, library: ModuleType, points: Points) -> tuple[Any, Any]:
        around = library.geometry.KDTreeSearchParamHybrid
        cloud = library.geometry.PointCloud(library.utility.Vector3dVector(points.astype(float)))
        cloud = cloud.voxel_down_sample(self.voxel)
        cloud.estimate_normals(around(self.normal_radius * self.voxel, self.normal_points))
        cloud.orient_normals_towards_camera_location(np.zeros(3))
        compute = library.pipelines.registration.compute_fpfh_feature
        features = around(self.feature_radius * self.voxel, self.feature_points)
        return cloud, compute(cloud, features)
