# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From the paper's method to ours, one change a rung (docs/accuracy.md)."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from experiments.tables.ablations import Part, changed
from experiments.tables.data import store_of
from experiments.tables.make import selected
from experiments.tables.measure import measure, method_of
from experiments.tables.rows import baselines, oracle, paper_form, small_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table, Trained
from experiments.tables.train import Workshop, model_of

from wildshape.errors import BadInputError
from wildshape.evaluation.cases import Case, prepare
from wildshape.evaluation.examples import pick
from wildshape.evaluation.method import Completer
from wildshape.evaluation.pictures import draw_panel
from wildshape.evaluation.protocol import complete_scans
from wildshape.evaluation.results import Limits
from wildshape.io.atomic import atomic_write
from wildshape.io.inputs import open_tracks
from wildshape.records import Points
from wildshape.training.recipes import small


def rungs(sources: Sources) -> tuple[Trained, ...]:
    """What is added, in order; each keeps what stands before it.

    Turned scans come with the bins, the window and the beta that were chosen for them.

    Raises:
        BadInputError: size full, where the two ends differ in widths, points and steps, too.
    """
    size, data = sources.size, sources.drives("train")
    if size.steps is None:
        raise BadInputError(
            "--size full: the paper's preset and ours differ in widths and steps, too; the ladder"
            " wants --size small."
        )
    base, goal = paper_form(size, data), small()
    if size.own_schedule:  # all rungs have one schedule
        base = replace(base, recipe=replace(base.recipe, optim=_ours(sources).recipe.optim))
    facing = _with(base, "views", turn="facing", window=goal.views.window)
    facing = _with(facing, "loss", projection=goal.loss.projection, beta=goal.loss.beta)
    mirror = _with(facing, "network", mirror=True)
    start = _with(mirror, "network", start=goal.network.start)
    loss = goal.loss
    headings = _with(start, "loss", time_ordered=loss.time_ordered, agree_at=loss.agree_at)
    ours = _ours(sources)
    taught = replace(ours, teacher=ours)
    return (
        replace(base, name="1 paper's form"),
        replace(facing, name="2 + scans turned towards their object"),
        replace(mirror, name="3 + mirror symmetry"),
        replace(start, name="4 + an ellipsoid at the start"),
        replace(headings, name="5 + agreed headings"),
        replace(ours, name="6 + a selector beside the cost"),
        replace(taught, name="7 + self-training on fused tracks"),
        replace(taught, name="8 + refined against the scan", answer="refined"),
        replace(taught, name="9 + all scans of the track", answer="track"),
    )


def _ours(sources: Sources) -> Trained:
    return small_form(sources.size, sources.drives("train"))


def _with(row: Trained, part: Part, **values: Any) -> Trained:
    return changed(row, row.name, part, **values)


def table(sources: Sources) -> Table:
    """The rungs, the oracle, and what needs no training."""
    size, data = sources.size, sources.drives("train")
    top = replace(oracle(size, data), name="oracle of the paper's form")
    plain = rungs(sources)[4]
    plain = replace(plain, name="7 without the selector", teacher=plain)
    student = replace(_with(_ours(sources), "network", branches=1), teacher=_ours(sources))
    student = replace(student, name="7 by a student of one branch")
    ours = replace(_ours(sources), name="oracle of our form", teacher="truth")
    rest = baselines("identity", "one-scan", "local-icp")
    rows = (*rungs(sources), plain, student, top, ours, *rest)
    block = Block("Simulated drives", sources.drives("test"), rows, (), ("none", "yaw"))
    note = "Each rung keeps those before it; 8 and 9 are the weights of 7, asked otherwise."
    return Table("From the paper's method to ours", (block,), size.seeds, (note,))


def draw(shop: Workshop, sources: Sources, path: Path) -> dict[str, object]:
    """Three objects on every rung; they are the best, the median and the worst of the first."""
    rows, test = rungs(sources), sources.drives("test")
    block = Block("rungs", test, rows)
    seeds, most = range(sources.size.seeds), sources.size.max_scans
    tried = [[measure(shop, row, block, "none", seed, most) for seed in seeds] for row in rows]
    best = [selected(row.name, tuple(m for m in ms if m)) for row, ms in zip(rows, tried)]
    chosen = pick(best[0].results.methods[0])
    wanted = {track: label for label, (track, _) in chosen.items()}
    tracks = [t for t in open_tracks(store_of(shop.folder, test)) if t.name in wanted]
    cases = {wanted[t.name]: prepare(t, "none", 0, Limits(max_scans=most)) for t in tracks}
    cases = {label: cases[label] for label in chosen}
    columns = []
    for row, one in zip(rows, best):
        method = method_of(shop, row, model_of(shop, row, one.results.seed))
        assert isinstance(method, Completer)
        columns.append({label: _completed(method, case) for label, case in cases.items()})
    with atomic_write(path) as file:
        _picture(rows, cases, columns).savefig(file, dpi=90, format="webp")
    seeds_ = {row.name: one.results.seed for row, one in zip(rows, best)}
    return {"objects": chosen, "seeds": seeds_, "measured": [one.made for one in best]}


def _completed(method: Completer, case: Case) -> Points:
    """The completion of a track's middle scan, in the object's true frame."""
    answer = complete_scans(method, case)[case.middle]
    assert answer is not None
    return _in_object(case, answer.points)


def _in_object(case: Case, points: Points) -> Points:
    assert case.T_sensor_object is not None
    return case.T_sensor_object[case.middle].inverse().apply_numpy(points)


def _picture(
    rows: tuple[Trained, ...], cases: dict[str, Case], columns: list[dict[str, Points]]
) -> Any:
    """A row a rung, a column an object; the scan and the truth above."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(cases), 1.55 * (len(rows) + 2)), layout="constrained")
    axes = figure.subplots(len(rows) + 2, len(cases), squeeze=False)
    titles = ("one scan", "truth", *(row.name for row in rows))
    for place, (label, case) in enumerate(cases.items()):
        assert case.truth is not None
        truth = case.truth.shape
        scan = _in_object(case, case.scans[case.middle])
        clouds = (scan, truth, *(column[label] for column in columns))
        for ax, title, cloud in zip(axes[:, place], titles, clouds, strict=True):
            draw_panel(ax, cloud, truth)
            ax.set_title(title, fontsize=8)
        axes[0, place].set_title(f"{label} of rung 1: one scan", fontsize=8)
    return figure
