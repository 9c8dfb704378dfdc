# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete, register and fuse with a trained network (METHOD 7)."""

import time
from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path

import torch

from wildshape.arguments import expect
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference import point_inputs
from wildshape.inference.compiled import compiled
from wildshape.inference.config import InferenceConfig
from wildshape.inference.free_space import Rays
from wildshape.inference.registration import fuse_scans, registered, to_middle
from wildshape.inference.single_scans import Looked, Posed, completed, looked_at, refined
from wildshape.inference.tracks.complete_track import Gathered, complete_together
from wildshape.inference.tracks.joint_icp import key_scans
from wildshape.inference.tracks.pose_outliers import SensorMotion
from wildshape.method.checkpoint import ModelSettings, load_checkpoint, weights_file
from wildshape.method.network import ShapePoseNet
from wildshape.ops.device import choose_device, plain_torch
from wildshape.records import Completion, Points, Registration, Sensor

BATCH = 32  # scans that are completed at once
Each = Iterable[object]  # handed in from Python, one a scan
_DEFAULT = InferenceConfig()


def load(
    model: str | Path | None = None,
    device: str | torch.device = "cpu",
    *,
    raw: bool = False,
    level: bool = True,
    config: InferenceConfig = _DEFAULT,
) -> "Predictor":
    """A predictor from a checkpoint; the weights shipped in the package by default.

    Args:
        model: checkpoint, folder of a run, or the name of other weights shipped (docs/models.md).
        device: cpu, cuda, or auto, which takes the GPU where there is one.
        raw: give the network's own answers, not refined against the scan (`refine.py`).
            Networks trained with a `paper-*` preset are never refined.
        level: LiDARs are held level to about a degree, as on a vehicle. Where a scan comes out
            within some five degrees of that, its refined pitch and roll are drawn to it; others
            are taken as tilted on purpose. False: not so, for sensors mounted askew by a few
            degrees, whose scans are not turned level first.
        config: the numbers that decide a result besides the checkpoint.

    Raises:
        BadInputError: the checkpoint cannot be used, or there is no GPU; the sentence says why.
    """
    place = choose_device(device)
    network, settings = load_checkpoint(weights_file(model))
    found = Predictor(network.to(place), settings, raw=raw, level=level, config=config)
    found.named = None if model is None else Path(model)
    return found


class Predictor:
    """A trained network and what it needs to know of its training. Sensor frames in and out.

    Args:
        network: trained.
        settings: of its training.
        raw: see `load`.
        level: see `load`.
        config: see `load`.
    """

    named: Path | None = None  # what `load` was asked for; None: the weights shipped, or no file

    def __init__(
        self,
        network: ShapePoseNet,
        settings: ModelSettings,
        *,
        raw: bool = False,
        level: bool = True,
        config: InferenceConfig = _DEFAULT,
    ) -> None:
        cure = "wildshape.load makes a Predictor of a file"
        expect(network, torch.nn.Module, "network", cure)
        self.network, self.settings = network, expect(settings, ModelSettings, "settings", cure)
        self.config = expect(config, InferenceConfig, "config")
        raw, level = expect(raw, bool, "raw"), expect(level, bool, "level")
        self.refines = settings.facing and not raw
        self.up = settings.up if level else None
        self.device = next(network.parameters()).device

    def __repr__(self) -> str:
        count = sum(weights.numel() for weights in self.network.parameters())
        low, high = self.settings.extent_m
        objects = f"{self.settings.sensor}, objects of {low:.1f} to {high:.1f} m"
        return f"Predictor({objects}, {count / 1e6:.1f} million weights, on {self.device})"

    def compile(self) -> "Predictor":
        """The same with its network compiled by `torch.compile`, ready when this returns.

        What the network says is equal to 1e-4 m; refinement may then match other points, and move
        single ones by centimetres. Where torch finds no compiler, a RuntimeWarning says so.
        """
        other = copy(self)
        other.network = compiled(self.network, self.settings.input_points)
        return other

    def complete(
        self, points: object, sensor: Sensor | None = None, *, rays: object = None
    ) -> Completion:
        """The complete shape of the object of one scan.

        Args:
            points: `(n, 3)` array or tensor, sensor frame, metres; or a file or an object of
                another library (`point_inputs.as_points`).
            sensor: how it was taken; by default as the scans trained on.
            rays: of the same frame that passed the object by, if known: `SightLines`, a file of
                them, or `directions`, `ranges` and perhaps `origins` as a dict or a tuple.

        Raises:
            BadInputError: not `(n, 3)`, fewer than 16 finite, different points, over 100 m or under
                1 cm across, over 1 km away; no `Sensor`; no rays, or of another scan.
        """
        return next(self.complete_many([points], sensor, rays=[rays]))

    def complete_many(
        self, scans: Each, sensor: Sensor | None = None, *, rays: object = None
    ) -> Iterator[Completion]:
        """`complete` for many scans, in batches; each is completed on its own.

        Nothing is done, or refused, before the first completion is taken. `rays`: None, or one set
        a scan, which may be None.

        Raises:
            BadInputError: as `complete`; the batches before have been given by then.
        """
        point_inputs.check_sensor(sensor)
        scans = point_inputs.each_of(scans)
        known = point_inputs.rays_of_each(rays, scans)
        for start in range(0, len(scans), BATCH):
            part = slice(start, start + BATCH)
            clouds = point_inputs.all_as_points(scans[part], start)
            point_inputs.check_all_rays(known[part], clouds, start)
            yield from self._each(clouds, sensor, known[part])

    def complete_track(
        self, scans: Each, sensor: Sensor | None = None, *, rays: object = None
    ) -> list[Completion]:
        """One shape from all scans of a track, in time order, posed in each of them.

        Headings are voted, poses refined against each other (`Completion.refined`), and the shape
        is drawn to what the scans saw (`complete_track.py`).

        Raises:
            BadInputError: as `complete`.
        """
        clouds, known = point_inputs.together(scans, rays, sensor)
        return list(self._together(clouds, sensor, known))

    def complete_checked(
        self,
        scans: Sequence[Points],
        sensor: Sensor | None = None,
        *,
        track: bool = False,
        rays: Rays = (),
    ) -> Iterable[Completion]:
        """`complete_many`, or with `track` `complete_track`, of scans that `io` has checked."""
        return self._together(scans, sensor, rays) if track else self._each(scans, sensor, rays)

    def _each(
        self, scans: Sequence[Points], sensor: Sensor | None, rays: Rays = (), dense: bool = True
    ) -> Iterator[Completion]:
        for start in range(0, len(scans), BATCH):
            began = time.perf_counter()
            batch = list(scans[start : start + BATCH])
            looked = self.look(batch, rays[start : start + BATCH])
            done = self.complete_looked(looked, sensor, dense=dense)
            seconds = (time.perf_counter() - began) / len(batch)
            yield from (replace(item, seconds=seconds) for item in done)

    @plain_torch()
    def _together(
        self, scans: Sequence[Points], sensor: Sensor | None, rays: Rays = ()
    ) -> Iterator[Completion]:
        began = time.perf_counter()
        if len(scans) > self.config.track.key_scans:
            done = complete_together(self._gathered(scans, sensor, rays), self.config, rays)
        else:
            done = self.put_together(self._each(scans, sensor, rays, len(scans) < 2), scans, rays)
        seconds = (time.perf_counter() - began) / max(len(scans), 1)
        return (replace(item, seconds=seconds) for item in done)

    def _gathered(self, scans: Sequence[Points], sensor: Sensor | None, rays: Rays) -> Gathered:
        """A long track: key scans are completed each on its own, the others looked at alone."""
        gathered = Gathered(self.settings)
        keys = set(key_scans(len(scans), self.config.track).tolist())
        for start in range(0, len(scans), BATCH):
            part = slice(start, start + BATCH)
            for i, looked in enumerate(self.look(list(scans[part]), rays[part]).each(), start):
                if i in keys:
                    (done,) = self.complete_looked(looked, sensor, dense=False)
                    gathered.add(done, scans[i])
                else:
                    gathered.pass_by(looked, sensor, self.config.reasons)
        return gathered

    def put_together(
        self,
        alone: Iterable[Completion],
        scans: Sequence[Points],
        rays: Rays = (),
        motion: SensorMotion | None = None,
    ) -> Iterator[Completion]:
        """One shape of a track's scans that were completed each on its own.

        Args:
            alone: a completion of each scan, in time order.
            scans: sensor frames, metres.
            rays: that passed the object by, one set a scan, if any are known.
            motion: how the sensor turned, if known: headings are then followed in the world.
        """
        if len(scans) < 2:
            return iter(list(alone))
        gathered = Gathered(self.settings)
        for cloud, done in zip(scans, alone):
            gathered.add(done, cloud)
        return complete_together(gathered, self.config, rays, motion)

    def register(
        self, source: object, target: object, sensor: Sensor | None = None, *, rays: object = None
    ) -> Registration:
        """`T_target_source` of two scans `(n, 3)`, sensor frames, metres; `rays`: of both.

        Raises:
            BadInputError: as `complete`.
        """
        point_inputs.check_sensor(sensor)
        pair = point_inputs.as_points(source, "source"), point_inputs.as_points(target, "target")
        known = point_inputs.rays_of_each(rays, pair)
        point_inputs.check_all_rays(known, pair)
        done = self._each(pair, sensor, known)
        return registered(*pair, done, self.config.inliers)

    def register_track(
        self, scans: Each, sensor: Sensor | None = None, *, track: bool = False, rays: object = None
    ) -> SE3:
        """`T_middle_scan`: every scan to the frame of the track's middle scan.

        Args:
            scans: of one object, in time order.
            sensor: how they were taken.
            track: pose the scans together (`complete_track`) and not each on its own.
            rays: of each, as in `complete`; None: of none.

        Raises:
            BadInputError: as `complete`, or there is no scan.
        """
        return to_middle(self.poses(scans, sensor, track=track, rays=rays))

    def poses(
        self, scans: Each, sensor: Sensor | None = None, *, track: bool = False, rays: object = None
    ) -> SE3:
        """`T_sensor_canonical` of each scan, as `register_track`."""
        clouds, known = point_inputs.together(scans, rays, sensor)
        if not clouds:
            raise BadInputError("no scans; hand in at least one.")
        done = self.complete_checked(clouds, sensor, track=track, rays=known)
        return stack([item.pose for item in done])

    def fuse(
        self, scans: Each, sensor: Sensor | None = None, *, track: bool = False, rays: object = None
    ) -> Points:
        """All points of a track in its middle scan's frame, metres, as `register_track`."""
        clouds = point_inputs.all_as_points(scans)
        return fuse_scans(clouds, self.register_track(clouds, sensor, track=track, rays=rays))

    @plain_torch()
    def look(self, scans: Sequence[Points], rays: Rays = ()) -> Looked:
        """What the network says of scans, in one batch, before they are completed."""
        off_ground = self.refines and self.settings.sensor == "lidar"
        known = self.network, self.settings, self.config
        return looked_at(scans, rays, *known, off_ground=off_ground)

    @plain_torch()
    def complete_looked(
        self, looked: Looked, sensor: Sensor | None = None, *, dense: bool = True
    ) -> list[Completion]:
        """Each scan that was looked at on its own; `dense`: of twice as many points."""
        posed = Posed.of(looked.found)
        if self.refines:
            up = None if self.up is None else torch.tensor(self.up, dtype=torch.float64)
            posed = refined(looked, up, self.settings, self.config.refine, self.device, dense=dense)
        known = self.settings, self.config
        return [completed(looked, i, posed, sensor, *known) for i in range(len(looked.scans))]
