# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's claims by one command: what is planned, done row by row, and found again."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from experiments.paper_tables import (  # pyright: ignore
    PRINTED,
    RECORD,
    Settings,
    changed,
    jobs,
    left_s,
    run,
    tables,
)
from experiments.tables.added import REMOVED  # pyright: ignore
from experiments.tables.size import SIZES  # pyright: ignore
from experiments.tables.sources import Sources  # pyright: ignore
from experiments.tables.table import Trained  # pyright: ignore

from experiments import paper_tables  # pyright: ignore
from wildshape.errors import BadInputError


@pytest.fixture(scope="module")
def planned():
    sources = Sources(SIZES["small"], Path("cad"))
    return jobs(tables(sources, 3), sources)


def test_the_plan_has_every_row_that_the_claims_need(planned):
    names = [job.name for job in planned]
    assert len(set(names)) == len(names)
    for wanted in (
        "vehicle, Simulated drives past cars: oracle, shape alone (the paper's)",
        "vehicle, Simulated drives past cars: DPC-LIDAR",
        "vehicle, Simulated drives past cars: global-icp",
        "views, Chair: DPC-dagger (pre-aligned)",
        "views, Car: ours, losses on 2D projections",
        "views, Airplane, depths with noise of 0.01: ours, paper's form, trained with noise",
        "ablations, Simulated drives, the paper's form: hindsight for a batch",
        "added, Simulated drives, ours: taught, w/o selector",
        "added, Simulated drives with occluders, ours: taught, with rays",
    ):
        assert f"{wanted}, 3 seeds, size small, CAD cad" in names
    ours = next(job for job in planned if "cars: ours, paper's form, 3 seeds" in job.name)
    assert [(block.accumulated, len(block.rotate)) for block in ours.blocks] == [(0, 3), (1, 1)]


def test_what_is_trained_once_is_counted_once(planned):
    trained = [job for job in planned if isinstance(job.row, Trained)]
    assert len({job.row.key for job in trained}) == sum(not job.known for job in trained)
    full = next(job for job in trained if "full: beta" in job.name)
    assert full.known
    assert full.guess_s < replace(full, known=False).guess_s


def test_what_is_left_goes_by_what_was_spent(planned):
    assert left_s(planned, {}, planned) == pytest.approx(sum(job.guess_s for job in planned))
    first, *todo = planned
    slow = {first.name: 3 * first.guess_s}
    assert left_s(todo, slow, planned) == pytest.approx(3 * sum(job.guess_s for job in todo))
    found, *todo = todo
    spent = slow | {found.name: 0.1}  # nothing was made for it
    assert left_s(todo, spent, planned) == pytest.approx(3 * sum(job.guess_s for job in todo))


def test_rows_are_made_and_found_again(tmp_path, monkeypatch, capsys):
    given = Settings(tmp_path, share=0.01, rows="identity")
    run(given, "the command")
    assert "0 of 4 rows are left" in capsys.readouterr().out
    spent = json.loads((tmp_path / RECORD).read_text("utf-8"))
    assert len(spent) == 4
    page = (tmp_path / PRINTED).read_text("utf-8")
    assert "| identity | " in page
    assert "CD floor" not in page
    assert "† 3D vehicle: Local-ICP" in page
    assert (tmp_path / "views-small-0.01.md").is_file()
    monkeypatch.setattr(paper_tables, "measure", None)
    (tmp_path / PRINTED).unlink()  # as after a stop
    run(given, "the command")
    assert (tmp_path / PRINTED).read_text("utf-8") == page
    assert json.loads((tmp_path / RECORD).read_text("utf-8")) == spent
    run(replace(given, table="vehicle"), "the command")
    assert (tmp_path / PRINTED).read_text("utf-8") == page


def test_a_stop_at_the_pages_leaves_their_row_to_be_done(tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    given = Settings(tmp_path, share=0.01, table="vehicle", rows="identity")
    with monkeypatch.context() as patched:
        patched.setattr(paper_tables, "write_pages", stop)
        with pytest.raises(KeyboardInterrupt):
            run(given, "the command")
    assert not (tmp_path / RECORD).exists()
    run(given, "the command")
    assert "| identity | " in (tmp_path / PRINTED).read_text("utf-8")


def test_a_folder_of_meshes_has_one_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    plans = []
    for cad in (Path("CAD"), Path("x/../CAD"), tmp_path / "CAD"):
        run(Settings(tmp_path, cad=cad, plan=True), "the command")
        plans.append(capsys.readouterr().out)
    assert plans[0] == plans[1] == plans[2]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("steps", "share", "cad", "seeds"),
    [
        (3000, 1.0, Path("cad"), 3),
        (None, 0.1, Path("cad"), 3),
        (None, 1.0, None, 3),
        (None, 1.0, Path("cad"), 1),
    ],
)
def test_what_gives_other_figures_is_another_job(planned, steps, share, cad, seeds):
    sources = Sources(changed(SIZES["small"], share, steps), cad)
    others = jobs(tables(sources, seeds), sources)
    assert len(others) == len(planned)
    assert not {job.name for job in others} & {job.name for job in planned}


def test_each_part_that_we_add_is_left_out_alone(planned):
    """One value differs from the full form, in both rounds; the teacher lacks the same part."""
    added = {job.row.name: job.row for job in planned if job.table == "added"}
    for removal in REMOVED:
        for form in ("first round", "taught"):
            less, full = added[f"{form}, w/o {removal.name}"], added[f"{form}, full"]
            parts = ("network", "loss", "views", "optim", "self_training")
            other = [getattr(less.recipe, p) != getattr(full.recipe, p) for p in parts]
            assert sum(other) == 1
            assert less.data == full.data
        assert added[f"taught, w/o {removal.name}"].teacher.recipe == less.recipe


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"rows": "nothing"}, "--rows nothing"),
        ({"rows": "identity,nothing"}, "--rows nothing"),
        ({"rows": "mirror", "table": "vehicle"}, "--rows mirror"),
        ({"seeds": 0}, "--seeds 0"),
        ({"share": 0.0}, "--share 0"),
    ],
)
def test_settings_that_leave_nothing_to_do_are_refused(tmp_path, changed, told):
    """Zero seeds would be named as one, whose row would then be taken for done."""
    with pytest.raises(BadInputError, match=told):
        run(replace(Settings(tmp_path, plan=True), **changed), "the command")


def test_a_share_has_a_name_of_its_own():
    small = SIZES["small"]
    assert changed(small, 1.0, None) == small
    shared = changed(small, 0.1, None)
    assert (shared.name, shared.train, shared.test, shared.steps) == ("small-0.1", 30, 6, 600)
    assert changed(small, 1.0, 3000).steps == 3000
