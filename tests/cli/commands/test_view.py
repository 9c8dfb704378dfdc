# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape view` without a browser; tests/report/viewer opens the page in one."""

import json
import shutil
import sys
import time
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest

from wildshape.cli.commands.view import Settings, source_of
from wildshape.cli.main import main
from wildshape.cli.options import FileOptions, NetworkOptions
from wildshape.errors import BadInputError
from wildshape.report.page.folder import report_from_folder


@pytest.fixture(scope="module")
def completed(store, tmp_path_factory):
    out = tmp_path_factory.mktemp("view") / "completed"
    main(["complete", str(store), "--out", str(out)])
    return out


@pytest.fixture(scope="module")
def evaluated(store, tmp_path_factory):
    out = tmp_path_factory.mktemp("view") / "evaluation"
    main(["evaluate", str(store), "--out", str(out), "--baselines", "none", "--max-scans", "2"])
    return out


def test_every_kind_of_input_can_be_shown(store, completed, evaluated):
    for path, tracks in ((completed, 6), (completed / "000001", 1), (store, 6), (evaluated, 6)):
        source = source_of(Settings(Path(path)))
        assert len(source.labels) == tracks, path
        track = source.track(0)
        made = dict(source.make(0, track, 1))
        assert sorted(made) == list(range(len(track.scans)))
        assert all(one.points is not None and one.box is not None for one in made.values())
    distances = [float(label.split("CD ")[1].split()[0]) for label in source.labels]
    assert distances == sorted(distances, reverse=True)
    assert "Worst object first" in source.note


def test_objects_are_in_the_order_of_the_report(evaluated, tmp_path):
    folder = shutil.copytree(evaluated, tmp_path / "two")
    for name in ("metrics.json", "scores.json"):
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace('"wildshape"', '"cars"'))
    said = json.loads((folder / "metrics.json").read_text())
    said["methods"]["cars, track"] = said["methods"]["cars"]
    (folder / "metrics.json").write_text(json.dumps(said))
    assert "by cars in this evaluation" in source_of(Settings(folder)).note


@pytest.mark.parametrize("named", ["000000", "renamed"])
def test_an_evaluation_s_scans_have_its_origin(evaluated, dataset, tmp_path, named):
    """Those that it ranks, and those of which it knows nothing."""
    folder = shutil.copytree(evaluated, tmp_path / "evaluation")
    said = json.loads((folder / "metrics.json").read_text())
    said["provenance"]["settings"]["origin"] = [1, 2, 3]
    (folder / "metrics.json").write_text(json.dumps(said))
    data = tmp_path / "data"
    shutil.copytree(dataset / "000000", data / named)
    first = source_of(Settings(data)).track(0).scans[0]
    shown = source_of(Settings(folder, inputs=data)).track(0).scans[0]
    np.testing.assert_allclose(shown, first - (1, 2, 3), atol=1e-5)


def test_what_cannot_be_shown_is_refused(refused, tmp_path):
    assert "no such file" in refused("view", tmp_path / "absent")
    assert "no scans" in refused("view", tmp_path)


def test_options_that_change_nothing_are_refused(completed, store):
    other = NetworkOptions(Path("car"))
    for asked in (Settings(completed, other), Settings(completed, files=FileOptions("mm"))):
        with pytest.raises(BadInputError, match="leave them out, or name the scans"):
            source_of(asked)
    with pytest.raises(BadInputError, match="--inputs: "):
        source_of(Settings(Path(store), inputs=Path(store)))


@pytest.mark.parametrize("single", [False, True])
def test_scans_that_changed_are_not_shown_beside_earlier_results(
    wildshape, dataset, store, tmp_path, single
):
    data = shutil.copytree(dataset / "000000", tmp_path / "data" / "000000")
    first, *_, last = sorted((data / "scans").iterdir())
    out = tmp_path / "out"
    assert wildshape("complete", first if single else data.parent, "--out", out).code == 0
    assert _shown(out) == (True, True, "")
    copy = shutil.copytree(data, tmp_path / "copy" / "000000")
    shutil.copytree(data, data.parent / "added")
    assert _shown(out) == (True, True, "")
    shutil.copy(last, first)
    assert _shown(out) == (False, True, "changed since")
    assert _shown(out, first if single else data.parent) == (True, True, "names others")
    assert _shown(out, copy / "scans" / first.name if single else copy) == (True, True, "")
    if not single:
        assert _shown(out, store) == (True, True, "")  # the same, packed
        first.rename(first.with_stem("renamed"))
        assert _shown(out, data) == (True, True, "")  # those that are left
        for scan in list((copy / "scans").iterdir()):
            scan.rename(scan.with_stem(f"other{scan.stem}"))
        assert _shown(out, copy) == (False, True, "changed since")


def _shown(out, inputs=None):
    """Whether scans are drawn, and their shapes; which of the sentences on scans is said."""
    source = source_of(Settings(out, inputs=inputs))
    track = source.track(0)
    drawn = report_from_folder(out, inputs).objects[0]
    panels = {cloud.label for cloud in drawn.clouds}
    scans, made = all(map(len, track.scans)), dict(source.make(0, track, 0)).values()
    shapes = all(one.points is not None for one in made)
    assert ("input scan" in panels, "completed" in panels) == (scans, shapes)
    said = "changed since", "names others"
    assert [one in track.source for one in said] == [one in drawn.subtitle for one in said]
    return scans, shapes, next((one for one in said if one in track.source), "")


def test_inputs_that_are_of_no_result_are_refused(refused, completed, evaluated, dataset, tmp_path):
    shutil.copytree(dataset / "000000", tmp_path / "data" / "renamed")
    said = "holds no track '000000'"
    assert said in refused("report", completed, "--inputs", tmp_path / "data")
    with pytest.raises(BadInputError, match=said):
        source_of(Settings(completed, inputs=tmp_path / "data"))
    assert "leave it out" in refused("report", evaluated, "--inputs", tmp_path / "data")


def test_the_drive_is_named_where_its_figures_are_given(refused, tmp_path):
    said = {"methods": {"wildshape": {}}, "provenance": {"settings": {"folder": "found"}}}
    (tmp_path / "metrics.json").write_text(json.dumps(said))
    assert "name what `drive` wrote: found." in refused("view", tmp_path)


@pytest.mark.parametrize("said", [{"methods": {}}, {"methods": {"a": {}}, "provenance": [1]}])
def test_what_evaluate_did_not_write_is_refused(refused, store, tmp_path, said):
    (tmp_path / "metrics.json").write_text(json.dumps(said))
    assert "metrics.json" in refused("view", tmp_path, "--inputs", store)


def test_without_viser_the_extra_is_named(refused, completed, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    said = refused("view", completed)
    assert "viser, which is not installed: pip install 'wildshape[view]'" in said


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_page_is_served_here_until_it_is_interrupted(wildshape, completed, monkeypatch):
    pytest.importorskip("viser", reason="did not run: viser is not installed (extra view)")
    from wildshape.report.viewer import page

    seen = []

    def once(served):
        while served.status or served.stage is None:
            time.sleep(0.01)
        with urlopen(served.url, timeout=60) as answer:
            seen.append((served.url, len(served.stage.completions), len(answer.read())))
        raise KeyboardInterrupt

    monkeypatch.setattr(page, "run_until_interrupted", once)
    monkeypatch.setattr(page, "_PATIENCE_S", 0.0)  # no browser comes
    found = wildshape("view", completed, "--port", "0", "--no-open", "--json")
    assert found.code == 0, found
    assert found.err == "closed\n"
    url, made, size = seen[0]
    assert json.loads(found.out) == {"url": url, "tracks": 6}
    assert url.startswith("http://127.0.0.1:")
    assert made == 6
    assert size > 100_000
