# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is handed between the parts: frozen records, metres, frames in the names.

Points are numpy float32 `(n, 3)`; poses are `SE3` over float64 tensors on the CPU. What holds
arrays is equal to itself alone; boxes and sensors are equal by their numbers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import torch
from jaxtyping import Float

from wildshape.arguments import check_fields, expect
from wildshape.errors import BadInputError
from wildshape.geometry.box import SIGNS, box_axes
from wildshape.geometry.projection.pinhole import Intrinsics
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.transforms.se3 import SE3, several
from wildshape.geometry.transforms.twist import Twist

if TYPE_CHECKING:
    import laspy
    import trimesh
    from numpy.typing import DTypeLike

Points = Float[np.ndarray, "_ 3"]
SensorKind = Literal["lidar", "camera"]
ShapeKind = Literal["whole", "mirrored", "partial"]
Unit = Literal["m", "cm", "mm"]


def as_text(name: str) -> str:
    r"""A name that can be written everywhere.

    Bytes of a file's name that are no UTF-8 are spelt out, such as `caf\xe9`, and so are halves of
    characters that JSON may hold.
    """
    if name.isascii():
        return name
    try:
        return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:
        return name.encode("utf-8", "backslashreplace").decode()


@dataclass(frozen=True)
class Sensor:
    """How a scan was taken.

    Attributes:
        kind: `lidar` (x forward, y left, z up) or `camera` (x right, y down, z forward).
        resolution_deg: angular steps (azimuth, elevation) of a LiDAR, degrees, if known.
        intrinsics: of a camera, if known.
    """

    kind: SensorKind = "lidar"
    resolution_deg: tuple[float, float] | None = None
    intrinsics: Intrinsics | None = None

    def __post_init__(self) -> None:
        """Refuse a kind that there is not: `LiDAR` would be another sensor."""
        if self.kind not in get_args(SensorKind):
            raise BadInputError(f"sensor {self.kind!r} is unknown; use 'lidar' or 'camera'.")
        check_fields(self)

    def __repr__(self) -> str:
        step, camera = self.resolution_deg, self.intrinsics
        steps = f", {step[0]:.3g} x {step[1]:.3g} degrees" if step else ""
        pixels = f", {camera.width} x {camera.height} pixels" if camera else ""
        return f"Sensor({self.kind}{steps}{pixels})"


@dataclass(frozen=True, eq=False)
class Turn:
    """A whole scan: one turn of a sensor.

    Attributes:
        points: each from where the sensor was when it was taken, sensor frame, metres.
        seconds: `(n,)` when each was taken, since the scan's own time; None if that is unknown.
        origins: `(n, 3)` where the ray of each began, where a data set has already moved the
            points to where they would be seen from the sensor's place at the scan's time.
        met: `(n,)` in place of `seconds`, where points have been moved so.
    """

    points: Points
    seconds: Float[np.ndarray, "_"] | None = None
    origins: Points | None = None
    met: Float[np.ndarray, "_"] | None = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        known = (self.points, self.seconds, self.origins, self.met)
        return sum(one.nbytes for one in known if one is not None)

    def carried(self, motion: Twist) -> Points:
        """The points where they would be seen from the sensor's place at the scan's time.

        As they are where their times are unknown.
        """
        return self.points if self.seconds is None else motion.carry(self.points, self.seconds)


@dataclass(frozen=True, eq=False)
class Track:
    """The scans of one rigid object in time order: the method's only supervision.

    Attributes:
        name: folder name, unique in its data set.
        scans: one `(n_i, 3)` float32 array a scan, metres, in its own sensor frame.
        scan_names: file stems, one a scan.
        sensor: how the scans were taken.
        category: for example `car`; empty if unknown.
        source: where it comes from, in words.
        T_sensor_object: truth, one pose a scan, for evaluation only.
        shape: truth, `(g, 3)` float32 surface points in the object frame, for evaluation only.
        rays: of each scan's frame those near the object that did not hit it, None for a scan
            without; empty where no scan has any.
        label_size_m: truth, length, width and height of the labelled box, for evaluation only.
        shape_kind: `shape` is `whole` if it is known, `partial` if it is all scans put together,
            `mirrored` if these were reflected besides.
    """

    name: str
    scans: tuple[Points, ...]
    scan_names: tuple[str, ...]
    sensor: Sensor = field(default_factory=Sensor)
    category: str = ""
    source: str = ""
    T_sensor_object: SE3 | None = None
    shape: Points | None = None
    rays: tuple[SightLines | None, ...] = ()
    label_size_m: tuple[float, float, float] | None = None
    shape_kind: ShapeKind = "whole"

    def __post_init__(self) -> None:
        """Names are text, whatever the file system holds.

        Raises:
            BadInputError: names that are no text, one array for all scans, or poses that are none.
        """
        for name in (self.name, self.category, self.source, *self.scan_names):
            expect(name, str, "a name of a track", "pass text")
        if getattr(self.scans, "ndim", 0) == 2:
            raise BadInputError(
                f"track {self.name}: expected several scans, found one array; put it in a tuple."
            )
        if self.T_sensor_object is not None and not isinstance(self.T_sensor_object, SE3):
            poses = several(self.T_sensor_object, f"poses of track {self.name}")
            object.__setattr__(self, "T_sensor_object", poses)
        object.__setattr__(self, "scan_names", tuple(map(as_text, self.scan_names)))
        for kept in ("name", "category", "source"):
            object.__setattr__(self, kept, as_text(getattr(self, kept)))
        if not any(rays is not None for rays in self.rays):
            object.__setattr__(self, "rays", ())

    def __repr__(self) -> str:
        counts = sorted(len(scan) for scan in self.scans) or [0]
        scans = f"{len(self.scans)} scans of {counts[0]} to {counts[-1]} points"
        truth = {"poses": self.T_sensor_object, "shape": self.shape}
        known = [f", true {name}" for name, value in truth.items() if value is not None]
        return f"Track({self.name!r}, {scans}, {self.category or self.sensor.kind}{''.join(known)})"

    @property
    def middle(self) -> int:
        """Index of the middle scan, the reference of registration and fusion (METHOD 7, 8)."""
        return len(self.scans) // 2

    def part(self, kept: Sequence[int]) -> "Track":
        """The same track with these of its scans alone."""
        poses = self.T_sensor_object
        return replace(
            self,
            scans=tuple(self.scans[i] for i in kept),
            scan_names=tuple(self.scan_names[i] for i in kept),
            T_sensor_object=None if poses is None else poses[torch.tensor(kept, dtype=torch.long)],
            rays=tuple(self.rays[i] for i in kept) if self.rays else (),
        )


@dataclass(frozen=True)
class Box:
    """An oriented box in the sensor frame.

    Attributes:
        centre: `(3,)` metres.
        size: `(3,)` full lengths along the box's own x (forward), y (left), z (up), metres.
        quaternion_wxyz: `(4,)` rotation from box to sensor frame.
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    quaternion_wxyz: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        """Arrays become tuples: what is compared and hashed.

        Raises:
            BadInputError: another number of numbers.
        """
        parts = self.centre, self.size, self.quaternion_wxyz
        if [(type(part), len(part)) for part in parts] != [(tuple, 3), (tuple, 3), (tuple, 4)]:
            check_fields(self)

    def __repr__(self) -> str:
        length, width, height = self.size
        centre = ", ".join(f"{value:z.2f}" for value in self.centre)
        sides = f"{length:.2f} x {width:.2f} x {height:.2f} m"
        return f"Box({sides}, centre ({centre}), yaw {math.degrees(self.yaw):z.1f} degrees)"

    @property
    def corners(self) -> Float[np.ndarray, "8 3"]:
        """The corners in the sensor frame, metres, float64.

        Corner `4 i + 2 j + k`: i is 0 at the rear (low x of the box), 1 in front; j is 0 on the
        right (low y), 1 on the left; k is 0 at the bottom, 1 on top.
        """
        return SIGNS * np.asarray(self.size) / 2 @ box_axes(self.quaternion_wxyz).T + self.centre

    @property
    def yaw(self) -> float:
        """Where the box's x axis points about the sensor's z axis: radians, -pi to pi.

        0 is the sensor's x, pi / 2 its y. Of a tilted box it is the direction of the x axis seen
        along z, its length left out of account; of one that stands upright on its end it means
        nothing. In a camera's frame z looks ahead, and this is no heading.
        """
        w, x, y, z = self.quaternion_wxyz
        return math.atan2(2 * (x * y + w * z), w * w + x * x - y * y - z * z)


@dataclass(frozen=True, eq=False)
class Completion:
    """One scan completed; everything in that scan's sensor frame, metres.

    `np.asarray(done)` is its points; `wildshape.save(done, "shape.ply")` writes them.

    Attributes:
        points: `(m, 3)` float32, the complete shape: the network's points, then, where
            refined, others that lie between them, were seen by scans or are reflections of such.
        pose: `T_sensor_canonical`.
        box: around the body that `points` and the scan show, without mirrors; x, the heading, is
            the canonical frame's.
        confidence: 0 to 1: the product of the three probabilities, where there are any.
        branch: the pose branch that spoke.
        cost: its label-free cost, metres (METHOD 6).
        refined: whether the pose was refined against the scan.
        warning: empty, or one sentence (for example a size outside the training range).
        reasons: why it is not to be trusted, in short names; empty where nothing speaks against
            it. `inference/confidence.py` and docs/formats.md say what each means.
        seconds: time spent on this scan.
        features: of the network's look at the scan (`method/confidence.py`).
        p_pose: probability of a heading within 10 degrees; None for weights that state none.
        p_box: of a box whose IoU with the true one, seen from above, is at least 0.7.
        p_kind: of an object of the kind trained on.
        evidence: what these three are made from (`method/trust.py`).
    """

    points: Points
    pose: SE3
    box: Box
    confidence: float
    branch: int
    cost: float
    refined: bool = False
    warning: str = ""
    reasons: tuple[str, ...] = ()
    seconds: float = 0.0
    features: tuple[float, ...] = ()
    p_pose: float | None = None
    p_box: float | None = None
    p_kind: float | None = None
    evidence: tuple[float, ...] = ()

    def __repr__(self) -> str:
        known = zip(("pose", "box", "kind"), (self.p_pose, self.p_box, self.p_kind))
        said = "".join(f", {name} {p:.2f}" for name, p in known if p is not None)
        said += f", {self.box!r}{', refined' if self.refined else ''}"
        said += f", not to be trusted: {', '.join(self.reasons)}" if self.reasons else ""
        said += f", warning: {self.warning}" if self.warning else ""
        return f"Completion({len(self.points)} points, confidence {self.confidence:.2f}{said})"

    def _repr_html_(self) -> str:
        """What a notebook shows: points and box in 3D, in one piece that needs no network."""
        from wildshape.geometry.figure import embedded

        return embedded(self.points, self.box.corners, repr(self))

    def show(self) -> Path:
        """Open points and box in the browser, in 3D: a temporary page that needs no network."""
        from wildshape.geometry.figure import opened

        return opened(self.points, self.box.corners, repr(self))

    def __array__(self, dtype: "DTypeLike | None" = None, copy: bool | None = None) -> np.ndarray:
        """The points."""
        return np.array(self.points, dtype=dtype, copy=copy)

    def to_torch(self) -> Float[torch.Tensor, "m 3"]:
        """The points as a tensor of its own, float32."""
        return torch.from_numpy(self.points.copy())

    def to_open3d(self) -> Any:
        """The points as an `open3d.geometry.PointCloud`.

        Raises:
            MissingExtraError: Open3D is not installed.
        """
        from wildshape.geometry.other_libraries import open3d_cloud

        return open3d_cloud(self.points)

    def to_trimesh(self) -> "trimesh.PointCloud":
        """The points as a `trimesh.PointCloud`; see also `mesh`."""
        from wildshape.geometry.other_libraries import trimesh_cloud

        return trimesh_cloud(self.points)

    def to_laspy(self) -> "laspy.LasData":
        """The points as a `laspy.LasData`, a tenth of a millimetre fine."""
        from wildshape.geometry.other_libraries import las_cloud

        return las_cloud(self.points)

    def mesh(self, scan: object = None) -> "trimesh.Trimesh":
        """A closed triangle mesh of the shape, sensor frame, metres; made when asked for.

        Args:
            scan: the points completed, `(n, 3)`, sensor frame; the mesh is then coloured by
                confidence, and has the vertex attribute `confidence` (`geometry/meshing.py`).
        """
        from wildshape.geometry.meshing import closed_mesh, colour_by_confidence

        mesh = closed_mesh(self.pose.inverse().apply_numpy(self.points))
        mesh.apply_transform(self.pose.matrix.numpy())
        if scan is not None:
            colour_by_confidence(mesh, scan, self.confidence)
        return mesh


@dataclass(frozen=True, eq=False)
class Registration:
    """Source registered to target.

    `np.asarray(found)` is the 4x4 matrix of `T_target_source`.

    Attributes:
        T_target_source: takes the source scan's points to the target scan's sensor frame.
        inlier_ratio: share of moved source points within 0.2 m (or 5 % of the object's extent
            where that is less) of a target point.
        confidence: 0 to 1, the smaller of the two completions'.
        warning: empty, or one sentence (see `Completion.warning`).
        reasons: those of both completions (see `Completion.reasons`).
    """

    T_target_source: SE3
    inlier_ratio: float
    confidence: float
    warning: str = ""
    reasons: tuple[str, ...] = ()

    def __repr__(self) -> str:
        shares = f"inlier ratio {self.inlier_ratio:.2f}, confidence {self.confidence:.2f}"
        said = f", warning: {self.warning}" if self.warning else ""
        return f"Registration({self.T_target_source!r}, {shares}{said})"

    def __array__(self, dtype: "DTypeLike | None" = None, copy: bool | None = None) -> np.ndarray:
        """`T_target_source` as a 4x4 matrix, row-major, metres."""
        return np.array(self.matrix, dtype=dtype, copy=copy)

    @property
    def matrix(self) -> Float[np.ndarray, "4 4"]:
        """`T_target_source` as a 4x4 matrix, row-major, metres."""
        return self.T_target_source.matrix.numpy()
