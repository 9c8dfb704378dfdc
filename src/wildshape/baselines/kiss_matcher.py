# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KISS-Matcher (Lim et al., ICRA 2025): features and a robust solver, no start needed."""

import os
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import version
from types import ModuleType

import numpy as np

from wildshape.baselines.pairs import about_centroids
from wildshape.errors import MissingExtraError
from wildshape.geometry.sampling import radius_inliers, voxel_thin
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor


def load_kiss_matcher() -> ModuleType:
    """The library.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return import_module("kiss_matcher")
    except ImportError as error:
        raise MissingExtraError(
            "kiss-matcher is not installed or does not load; `pip install kiss-matcher` has wheels"
            f" for Python 3.11 and 3.12 on Linux (x86-64) and macOS (arm64) ({error})."
        ) from error


@dataclass(frozen=True)
class KissMatcher:
    """A pair of scans matched by features.

    Clouds stay in their sensors' frames: the library turns normals towards the origin.

    Attributes:
        voxel: edge of the cubes the clouds are thinned by, metres; scales every radius.
        normal_radius: within which the library looks for a normal's points, in voxels.
        features: a cloud with fewer points that can have a normal is not matched: without features
            the library ends the whole process (measured).
        neighbours: points that a normal needs within its radius.
    """

    # From experiments/search_baselines.py.
    voxel: float = 0.1
    normal_radius: float = 3.0
    features: int = 10
    neighbours: int = 5

    def __post_init__(self) -> None:
        """Refuse at once what could not run later.

        Raises:
            MissingExtraError: the library is not installed.
        """
        load_kiss_matcher()

    @property
    def about(self) -> str:
        """The method and its settings in a line."""
        return f"{self.engine} of neighbours, chained; voxel {self.voxel:g} m"

    @property
    def engine(self) -> str:
        """The library."""
        return f"KISS-Matcher {version('kiss-matcher')}"

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:  # noqa: ARG002
        """`T_target_source`; centroids aligned, no rotation, where nothing matches."""
        library = load_kiss_matcher()
        _settle_on_one_thread()
        clouds = [voxel_thin(points, self.voxel) for points in (source, target)]
        if min(map(self._featured, clouds)) >= self.features:
            config = library.KISSMatcherConfig(voxel_size=self.voxel, use_voxel_sampling=False)
            found = library.KISSMatcher(config).estimate(*(list(cloud) for cloud in clouds))
            if found.valid:
                return _transform(found.rotation, found.translation)
        return about_centroids(source, target, lambda *_: SE3.identity())

    def _featured(self, cloud: Points) -> int:
        """Points with a neighbourhood large enough for a normal."""
        reach = self.normal_radius * self.voxel
        return int(radius_inliers(cloud, reach, self.neighbours).sum())


@cache
def _settle_on_one_thread() -> None:
    """Make the library's pool as large as the cores that it sees when it first runs: one.

    Several of its threads write the same entries of a table of matches, and once in about
    three thousand pairs another match came out (measured). Where the system has no such setting its
    pool stays as it is.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    library = load_kiss_matcher()
    cloud = list(np.random.default_rng(0).random((100, 3)).astype(np.float32))
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        library.KISSMatcher(library.KISSMatcherConfig(voxel_size=0.2)).match(cloud, cloud)
    finally:
        os.sched_setaffinity(0, cores)


def _transform(rotation: np.ndarray, translation: np.ndarray) -> SE3:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, np.ravel(translation)
    return SE3.from_matrix(matrix)
