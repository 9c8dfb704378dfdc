# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A raw drive in, every vehicle out."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from wildshape.arguments import as_path, expect
from wildshape.drives.adapting import second_pass
from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.clock import Clock, Watch, silent
from wildshape.drives.config import INFERENCE, DriveConfig
from wildshape.drives.pipeline import SECONDS, Pipeline
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.result import FILES, DriveResult, earlier_result, line_of, settings_of
from wildshape.drives.tracking.detections import DetectionFile, find_detections
from wildshape.drives.writing.files import DriveFiles
from wildshape.drives.writing.folder import BOXES, FRAMES
from wildshape.errors import BadInputError
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import released_after
from wildshape.io.output import begin, finished, keep_apart, remove_leftovers
from wildshape.method.checkpoint import weights_file
from wildshape.parallel.team import ALONE, Team, check_workers, team

if TYPE_CHECKING:
    from wildshape.drives.adapting.adapt import Adaptation

_DEFAULT, _NO_FILES = DriveConfig(), DriveFiles()
_LONG = 20  # scans take longer than a helper's start


def drive(
    source: Path | str,
    out: Path | str = "found",
    config: DriveConfig = _DEFAULT,
    *,
    topic: str | None = None,
    predictor: Predictor | Path | str | None = None,
    workers: int | Team | None = None,
    files: DriveFiles = _NO_FILES,
    detections: DetectionFile | Path | str | None = None,
    adapt: "AdaptConfig | Adaptation | bool | None" = None,
    overwrite: bool = False,
    watch: Watch = silent,
) -> DriveResult:
    """Find every vehicle of a raw recording: its track, boxes and complete shape, without labels.

    An interrupted run is gone on with; of a finished one only the files asked for are written.

    Args:
        source: a folder of full scans, a drive of a published data set, or a recording of ROS or
            of packets (`recordings`).
        out: folder to write (docs/drive.md); by default `found` where Python runs.
        config: the numbers of every stage.
        topic: of point clouds, for a recording of ROS that holds several.
        predictor: for scans of LiDARs, or the weights that `load` takes; by default the shipped
            ones.
        workers: processes that cut scans and complete objects; None: one a core; or those of a
            `parallel.team.team` that are there already.
        files: what else to write into the folder.
        detections: the file of what somebody else's detector found, in place of the clusters.
        adapt: an `AdaptConfig`, or True for the usual one: train the model on what was found, and
            complete the drive again if it is better; or what came of that already
            (`adapting.adapt`), for several drives.
        overwrite: remove an earlier output first.
        watch: told of progress.

    Raises:
        BadInputError: source, weights, detections or output cannot be used.
        MissingExtraError: a library is not installed.
    """
    source, out = as_path(source, "source"), as_path(out, "out")
    expect(config, DriveConfig, "config")
    expect(files, DriveFiles, "files", "for example DriveFiles(mcap=True)").check()
    adapt, detections = _adaptation(adapt), _detections(detections)
    check_workers(workers)
    recording = open_drive(source, topic)
    given = None
    if detections is not None:
        given = find_detections(detections, recording)
        recording = given.noted(recording)
        keep_apart(out, detections.path)
    if not isinstance(predictor, Predictor):
        predictor = load(predictor, config=INFERENCE)
    _check_lidar(predictor)
    keep_apart(out, source, predictor.named and weights_file(predictor.named))
    settings = settings_of(source, recording, topic, config, predictor, detections)
    line = line_of(source, out, topic, config, detections, predictor.named)
    with released_after(out):
        second_pass.put_in_place(out)
        run = Pipeline(recording, out, config, predictor, ALONE, given, Clock(watch))
        done = None if overwrite else finished(out, "drive", settings, parts=(BOXES, FRAMES))
        if done is None:
            output = begin(out, "drive", settings, FILES, overwrite=overwrite, line=line)
            soon = Pipeline.__module__ if len(recording) >= _LONG else None
            with output.abandoned_if_refused(), team(workers, soon=soon) as helpers:
                clock = run.clock.going_on(run.stages / SECONDS)
                found = replace(run, helpers=helpers, clock=clock).perform()
            output.finish(result={**asdict(found), "out": str(out)})
        else:
            remove_leftovers(out)  # of a second pass, or of the files asked for
            found = earlier_result(out, done)
        if isinstance(adapt, AdaptConfig):
            from wildshape.drives.adapting.adapt import adapt_to

            adapt = adapt_to([out], out, predictor, adapt, watch=watch)
        if adapt is not None and adapt.model and not second_pass.is_done(out, adapt.model):
            with team(workers) as helpers:
                found = replace(run, helpers=helpers).again(adapt.model, found)
        files.write(out)
        return found


def _adaptation(given: object) -> "AdaptConfig | Adaptation | None":
    """What is handed in as `adapt`; True is the usual way."""
    if given is None or isinstance(given, bool):
        return AdaptConfig() if given else None
    if not isinstance(given, AdaptConfig):
        from wildshape.drives.adapting.adapt import Adaptation

        return expect(given, Adaptation, "adapt", "pass True or an AdaptConfig")
    return given


def _detections(given: object) -> DetectionFile | None:
    if given is None or isinstance(given, DetectionFile):
        return given
    return DetectionFile(as_path(given, "detections"))


def _check_lidar(predictor: Predictor) -> None:
    """Refuse weights of depth cameras: `car` is a name of such, and would find nothing."""
    sensor = predictor.settings.sensor
    if sensor != "lidar":
        raise BadInputError(
            f"{predictor.named or predictor}: was trained on {sensor} scans, but drives are of"
            " lidar scans; choose other weights by --model, or none for the shipped ones."
        )
