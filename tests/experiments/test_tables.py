# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the paper: made in their smallest size, found again, and as they are declared."""

import json
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from experiments.tables import data, ladder, make, train  # pyright: ignore
from experiments.tables.__main__ import TABLES, Settings, main  # pyright: ignore
from experiments.tables.data import Simulated, as_values, store_of  # pyright: ignore
from experiments.tables.measure import Measured, as_results  # pyright: ignore
from experiments.tables.show import Part, markdown, record  # pyright: ignore
from experiments.tables.size import SIZES, sized  # pyright: ignore
from experiments.tables.sources import Sources  # pyright: ignore
from experiments.tables.table import Baseline, Block, Table, Trained  # pyright: ignore
from experiments.tables.train import Model  # pyright: ignore
from experiments.tables.tsne import tsne  # pyright: ignore
from PIL import Image
from tests.cars import drive_by
from tests.refusal import refused

from wildshape.baselines.identity import Identity, OneScan
from wildshape.errors import BadInputError
from wildshape.evaluation.metrics import BoxScore
from wildshape.evaluation.protocol import run
from wildshape.evaluation.results import Results
from wildshape.evaluation.summary import figures_of
from wildshape.io.store.store import open_store
from wildshape.simulate.generate import SimulationConfig
from wildshape.training.config import learning_rate
from wildshape.training.recipes import PRESETS, default, paper_lidar

ROWS = "paper's form,identity"
TWO = ("vehicle", "ladder")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tables")


def test_vehicle_table(folder):
    main(Settings("vehicle", "test", folder, rows=ROWS), "the command")
    page = (folder / "vehicle-test.md").read_text("utf-8")
    assert "`the command`, commit " in page
    assert "| ours, paper's form | 2 |" in page
    assert "selected without labels" in page
    assert "† 3D vehicle: oracle" in page
    assert "Only rows with" in page
    made = json.loads((folder / "vehicle-test.json").read_text("utf-8"))
    assert [part["rotate"] for part in made["parts"]] == ["none", "yaw", "so3", "none"]
    known, fused = (made["parts"][i]["methods"]["identity"] for i in (0, 3))
    assert (known["truth"], fused["truth"]) == ("shape", "mirrored")
    assert known["cd_partial"] is None
    assert fused["coverage_partial"] < fused["coverage"]
    assert known["acc30"] == fused["acc30"]
    ours = made["parts"][0]["rows"]["ours, paper's form"]
    assert ours["recipe"]["optim"]["steps"] == 10
    assert len(ours["trained"]) == 2
    assert all(one["provenance"]["code"] for one in ours["trained"])
    figures = made["parts"][0]["methods"]
    assert set(figures["ours, paper's form"]["per_seed"]) == {"0", "1"}
    assert set(figures["identity"]["per_seed"]) == {"0"}
    assert figures["identity"]["cd"] > figures["identity"]["cd_floor"] > 0


def test_a_table_finds_what_another_trained_and_measured(folder, monkeypatch):
    """The ladder begins as the table of vehicles, made before, by another name of the row."""
    if not (folder / "vehicle-test.json").exists():
        main(Settings("vehicle", "test", folder, rows=ROWS), "the command")
    monkeypatch.setattr(train, "setup", None)
    main(Settings("ladder", "test", folder, rows="1 paper's form,identity"), "another command")
    made = [json.loads((folder / f"{n}-test.json").read_text("utf-8"))["parts"][0] for n in TWO]
    assert made[0]["provenance"]["identity"] == made[1]["provenance"]["identity"]
    first, second = (part["methods"] for part in made)
    ours = first["ours, paper's form"], second["1 paper's form"]
    assert ours[0] == ours[1]


def test_figures_of_objects_and_codes(folder):
    """Of the same training; the objects are the best, the median and the worst of those tested."""
    for name in ("objects", "codes"):
        main(Settings(name, "test", folder), "the command")
        with Image.open(folder / f"{name}-test.webp") as picture:
            assert min(picture.size) > 300
    made = json.loads((folder / "objects-test.json").read_text("utf-8"))
    assert "selected without labels" in made["method"]
    errors = [made["objects"][label]["cd_m"] for label in ("best", "median", "worst")]
    assert errors == sorted(errors)
    assert errors[0] < errors[2]
    places = json.loads((folder / "codes-test.json").read_text("utf-8"))["places"]
    assert len(places) == SIZES["test"].test


@pytest.mark.parametrize(
    ("name", "size"), [one for one in product(TABLES, SIZES) if one != ("ladder", "full")]
)
def test_tables_as_declared(name, size):
    """No two rows of a table are called alike or trained alike; every size and table exists."""
    table = TABLES[name](Sources(SIZES[size], Path("cad"), Path("kitti")))
    for block in table.blocks:
        names = [row.name for row in block.rows]
        keys = [(r.key, r.answer) for r in block.rows if isinstance(r, Trained)]
        assert len(set(names)) == len(names)
        assert len(set(keys)) == len(keys)
        assert block.paper or name in ("encoders", "added", "ladder") or "noise" in block.title


def test_a_table_that_needs_a_folder_says_so():
    for name, option in (("kitti", "--kitti"), ("trucks", "--cad")):
        with pytest.raises(BadInputError, match=option):
            TABLES[name](Sources(SIZES["tiny"]))


def test_data_that_are_measured_are_looked_at_before_anything_is_trained(tmp_path):
    given = Settings("kitti", "test", tmp_path, kitti=tmp_path / "nowhere")
    with pytest.raises(BadInputError, match=r"nowhere: no such folder"):
        main(given, "the command")
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("row", "said"),
    [("car,a.ply,test", "a.ply, which is not"), ("bus,a.ply,test", "no mesh of car")],
)
def test_meshes_that_are_not_there_are_named_as_the_manifest_does(tmp_path, row, said):
    manifest = tmp_path / "cad" / "manifest.csv"
    manifest.parent.mkdir()
    manifest.write_text(f"\ufeffcategory,file,split\n{row}\n", "utf-8")
    given = Settings("vehicle", "test", tmp_path, cad=manifest.parent, rows="^identity")
    with pytest.raises(BadInputError, match=f"manifest.csv: lists .*{said}"):
        main(given, "the command")


def test_trucks_are_measured_against_partial_truth_as_the_papers_are():
    known, accumulated = TABLES["trucks"](Sources(SIZES["tiny"], Path("cad"))).blocks
    assert (known.accumulated, accumulated.accumulated) == (False, True)
    (row,) = accumulated.paper
    assert (row.cd, row.cd_partial) == (None, 0.2942)


def test_rows_that_are_not_there():
    table = TABLES["encoders"](Sources(SIZES["tiny"]))
    ablations = TABLES["ablations"](Sources(SIZES["tiny"]))
    found = make.chosen_rows(ablations, ("^w/o projection",)).blocks
    assert [row.name for block in found for row in block.rows] == ["w/o projection"]
    refused(make.chosen_rows, table, ("nothing",), match="no row")


def test_protocols_that_are_chosen_and_that_are_not_there():
    table = TABLES["vehicle"](Sources(SIZES["tiny"]))
    chosen = make.chosen_protocols(table, ("yaw",))
    assert [block.rotate for block in chosen.blocks] == [("yaw",)]
    assert make.chosen_protocols(table, ()) == table
    refused(make.chosen_protocols, table, ("upside-down",), match="protocol")


def test_a_protocol_that_is_not_there_is_not_passed_over_beside_one_that_is():
    table = TABLES["vehicle"](Sources(SIZES["tiny"]))
    with pytest.raises(BadInputError, match="--rotate upside-down: this table"):
        make.chosen_protocols(table, ("yaw", "upside-down"))


@pytest.mark.parametrize(
    ("table", "changed", "told"),
    [
        ("vehicle", {"rows": "identity,nothing"}, "--rows nothing"),
        ("vehicle", {"steps": 0}, "--steps 0"),
        ("vehicle", {"seeds": -1}, "--seeds -1"),
        ("objects", {"rows": "identity"}, "leave out --rows"),
        ("codes", {"rotate": "yaw"}, "--rotate"),
    ],
)
def test_options_that_would_change_nothing_or_train_nothing_are_refused(
    tmp_path, table, changed, told
):
    with pytest.raises(BadInputError, match=told):
        main(replace(Settings(table, "test", tmp_path), **changed), "the command")
    assert not list(tmp_path.iterdir())


def test_a_manifest_without_its_columns_is_one_sentence(tmp_path):
    (tmp_path / "manifest.csv").write_text("file,kind\na.ply,car\n", encoding="utf-8")
    with pytest.raises(BadInputError, match="no column category, split"):
        store_of(tmp_path / "out", Sources(SIZES["test"], tmp_path).drives("test"))


def test_size_keeps_what_is_minimised():
    recipe = paper_lidar()
    tiny = sized(recipe, SIZES["tiny"])
    assert tiny.loss == recipe.loss
    assert tiny.network.branches == recipe.network.branches
    assert tiny.optim.steps == SIZES["tiny"].steps
    for preset in PRESETS.values():
        assert sized(preset(), SIZES["full"]) == preset()


def test_a_rung_of_the_ladder_changes_nothing_but_the_method():
    for size in ("test", "tiny", "hour", "small"):
        made: list[Any] = [row.recipe for row in ladder.rungs(Sources(SIZES[size]))]
        widths = {(r.network.encoder, r.network.decoder, r.network.points) for r in made}
        assert len(widths) == len({(r.optim, r.views.points) for r in made}) == 1
    with pytest.raises(BadInputError, match="--size full"):
        ladder.table(Sources(SIZES["full"]))


def test_size_small_keeps_the_papers_schedule_shortened_evenly():
    """Its learning rate falls after the same shares of the run by the same factor."""
    whole = paper_lidar().optim
    short, ours = (sized(make_(), SIZES["small"]).optim for make_ in (paper_lidar, default))
    assert (short.warmup, short.average, short.clip, short.steps) == (0, 0, 0, 6000)
    for share in (0.0, 0.249, 0.251, 0.6, 0.999):
        falls = [learning_rate(int(share * o.steps), o) / o.lr for o in (whole, short)]
        assert falls[0] == pytest.approx(falls[1])
    assert (ours.decay_every, ours.average) == (0, 0.998)
    assert sized(paper_lidar(), SIZES["hour"]).optim.decay_every == 0


def test_data_that_a_stop_left_half_made_are_made_again(tmp_path, monkeypatch):
    def stopped(config, seed):
        yield drive_by("first", scans=2, points=60)
        raise KeyboardInterrupt

    cars = Simulated("cars", SimulationConfig(tracks=2), seed=1)
    monkeypatch.setattr(data, "simulate_tracks", stopped)
    with pytest.raises(KeyboardInterrupt):
        store_of(tmp_path, cars)
    whole = [drive_by(name, scans=2, points=60) for name in ("first", "second")]
    monkeypatch.setattr(data, "simulate_tracks", lambda config, seed: whole)
    assert open_store(store_of(tmp_path, cars)).names == ("first", "second")


def test_rows_of_equal_names_in_other_blocks_are_all_recorded():
    table = TABLES["views"](Sources(SIZES["test"]))
    measured = (Measured(run({"m": OneScan()}, [drive_by(scans=2, points=60)]), {}, None),)
    parts = [Part(b, "none", tuple((row, measured) for row in b.rows), {}) for b in table.blocks]
    found = [
        row.get("data") for p in record(table, parts, {})["parts"] for row in p["rows"].values()
    ]
    trained = [as_values(r.data) for b in table.blocks for r in b.rows if isinstance(r, Trained)]
    assert [one for one in found if one] == trained


def test_a_page_names_every_commit_that_trained_or_measured_a_row():
    """Rows are found again, so that the commit that prints them need not be one of these."""
    clean, changed, printing = ("a" * 40, f"{'b' * 40} with changes", "c" * 40)
    found = run({"m": OneScan()}, [drive_by(scans=2, points=60)])
    model = Model(Path("m"), {"provenance": {"code": changed}})
    block = Block("b", Sources(SIZES["test"]).drives("test"), (row := Baseline("m"),))
    part = Part(block, "none", ((row, (Measured(found, {"code": clean}, model),)),), {})
    made = {"code": printing, "time_utc": "today", "hardware": {"cpu": "x", "gpu": None}}
    page = markdown(Table("t", (block,), 1), [part], "the command", made)
    assert "\n`the command`, commit aaaaaaa, bbbbbbb with changes, today, x, no GPU.\n" in page


def test_scores_are_read_as_they_were_written():
    tracks = [drive_by(scans=3, points=60), replace(drive_by(scans=2, points=60), shape=None)]
    found = run({"scan": OneScan(), "identity": Identity()}, tracks, "yaw", 3)
    scan, identity = found.methods
    boxed = tuple(replace(row, box=BoxScore(0.5, 12.0)) for row in scan.completions)
    found = replace(found, methods=(replace(scan, completions=boxed), identity))
    assert as_results(json.loads(json.dumps(asdict(found))), found.limits) == found


def test_seed_is_selected_by_its_cost_and_not_by_the_truth(monkeypatch):
    truth = [run({"m": OneScan()}, [drive_by(scans=2, points=n)], seed=n) for n in (60, 400)]
    worst = min(truth, key=lambda r: -(figures_of(r["m"])["cd"] or 0.0))
    measured = tuple(Measured(r, {}, None) for r in truth)
    costs = {60: 0.1, 400: 0.2}
    monkeypatch.setattr(make, "_cost", lambda one: costs[one.results.seed])
    chosen = make.selected("ours", measured).results
    assert isinstance(chosen, Results)
    assert chosen.seed == worst.seed == 60
    assert chosen.methods[0].name == "ours, seed 60, selected without labels"


def test_tsne_keeps_neighbours_together():
    rng = np.random.default_rng(0)
    kind = np.repeat(np.arange(3), 15)
    places = tsne(rng.normal(size=(3, 32))[kind] * 5 + rng.normal(size=(45, 32)), perplexity=8)
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1) + 1e9 * np.eye(45)
    assert (kind[apart.argmin(1)] == kind).all()
    middles = np.stack([places[kind == k].mean(0) for k in range(3)])
    inside = max(np.linalg.norm(places[kind == k] - middles[k], axis=1).max() for k in range(3))
    between = np.linalg.norm(middles[:, None] - middles[None], axis=-1)[np.triu_indices(3, 1)].min()
    assert between > inside
