# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""On a cluster of two machines, as Ray sees them: a worker is killed at its work, a machine lost.

What is written is what one process writes.
"""

import importlib.util
import os
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.cli.test_workers import written
from tests.drives.street import street, write_scans

from wildshape.evaluation.protocol import run
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.folders.complete_folder import FILES, FolderOptions, write_results
from wildshape.inference.predictor import Predictor, load
from wildshape.io.inputs import open_tracks
from wildshape.io.output import begin
from wildshape.parallel.team import team
from wildshape.report.drive.many import DriveAndPage, drive_many

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: not run"
)
_BYTES = 100 * 2**20


@pytest.fixture(scope="module")
def cluster():
    """Two machines of one processor each, as far as Ray knows; gives what loses one."""
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    how = {"num_cpus": 1, "object_store_memory": _BYTES, "include_dashboard": False}
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))
        patched.setenv("RAY_USAGE_STATS_ENABLED", "0")
        found = Cluster(initialize_head=True, head_node_args=how)
        other = found.add_node(num_cpus=1, object_store_memory=_BYTES)
        ray.init(address=found.address, log_to_driver=False, configure_logging=False)
        yield lambda: found.remove_node(other, allow_graceful=False)
        ray.shutdown()
        found.shutdown()


@dataclass(frozen=True)
class Strike:
    """Kills the process at its second answer, once; `attempts` holds a line for each beginning."""

    folder: Path

    def at(self, answers):
        with (self.folder / "attempts").open("a") as file:
            file.write("begun\n")
        for number, answer in enumerate(answers):
            if number == 1 and not (self.folder / "killed").exists():
                (self.folder / "killed").touch()
                os.kill(os.getpid(), signal.SIGKILL)
            yield answer

    @property
    def attempts(self):
        assert (self.folder / "killed").exists()
        return len((self.folder / "attempts").read_text().splitlines())


class Killed(Predictor):
    strike: Strike

    def complete_checked(self, *given, **known):
        return self.strike.at(super().complete_checked(*given, **known))

    def complete_many(self, *given, **known):
        return self.strike.at(super().complete_many(*given, **known))

    def put_together(self, *given, **known):
        return self.strike.at(super().put_together(*given, **known))


@pytest.fixture(scope="module")
def alone():
    return load()


@pytest.fixture
def killed(alone, tmp_path):
    found = Killed(alone.network, alone.settings)
    found.strike = Strike(tmp_path)
    return found


def test_complete_with_a_worker_killed(cluster, dataset, alone, killed, tmp_path):
    found = {}
    for name, predictor, ray in (("alone", alone, None), ("on ray", killed, "auto")):
        output = begin(tmp_path / name, "complete", {}, FILES)
        options = FolderOptions(workers=1, ray=ray)
        found[name] = write_results(open_tracks(dataset), predictor, output, options)
    assert (found["on ray"].tracks, found["on ray"].scans, found["on ray"].workers) == (6, 36, 2)
    assert killed.strike.attempts == 6 + 1
    assert written(tmp_path / "on ray") == written(tmp_path / "alone")
    assert not list((tmp_path / "on ray").rglob(".*"))


def test_evaluate_with_a_worker_killed(cluster, dataset, alone, killed):
    tracks = [track.part([0, 1, 2]) for track in open_tracks(dataset)][:3]
    expected = run({"ours": Learned(alone)}, tracks, "yaw")
    with team(ray="auto") as helpers:
        found = run({"ours": Learned(killed)}, tracks, "yaw", helpers=helpers)
    assert found == expected
    assert killed.strike.attempts == 3 + 1


def test_a_drive_whose_worker_is_killed_goes_on_with_another(cluster, alone, killed, tmp_path):
    scans = street().scans[:5]
    for name, part in {"monday": scans, "tuesday": [scan[::40] for scan in scans]}.items():
        write_scans(tmp_path / name, part)
    folders = {tmp_path / name: tmp_path / "out" / name for name in ("monday", "tuesday")}
    found = drive_many(DriveAndPage(killed, report=False), folders, ray="auto")
    assert [one.out.name for one in found.found] == ["monday", "tuesday"]
    assert (tmp_path / "killed").exists()
    drive = DriveAndPage(alone, workers=1, report=False)
    expected = drive.find(tmp_path / "monday", tmp_path / "alone")
    assert found.found[0].vehicles == expected.vehicles
    assert written(tmp_path / "out" / "monday") == written(tmp_path / "alone")
    cut = tmp_path / "out" / "monday" / "stages" / "clusters" / "000000.npz"
    assert cut.stat().st_mtime < (tmp_path / "killed").stat().st_mtime  # it went on from there


def counted_in(folder):
    return lambda number: (
        time.sleep(0.3),
        (folder / f"{number}-{time.time_ns()}").touch(),
        number,
    )[2]


def test_a_machine_is_lost(cluster, tmp_path):
    with team(ray="auto") as helpers:
        assert helpers.size == 2
        found = []
        for number in helpers.as_done(counted_in(tmp_path), range(24)):
            if not found:
                cluster()
            found.append(number)
        assert sorted(found) == list(range(24))
        assert list(helpers.in_order(counted_in(tmp_path), range(3))) == [0, 1, 2]
    assert 24 + 3 <= len(list(tmp_path.iterdir())) <= 24 + 3 + 2
