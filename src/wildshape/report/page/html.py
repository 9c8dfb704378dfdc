# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The report as one HTML file that needs no network: plotly's script and all data are inside.

The page carries a Content-Security-Policy that forbids every load from outside, so the browser
itself keeps the promise.
"""

import base64
import json
import math
import os
import re
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from wildshape.io.atomic import write_text
from wildshape.report.content import (
    SERIES_COLORS,
    Cell,
    Cloud,
    Curve,
    Figure,
    Numbers,
    Report,
    ReportObject,
    SceneView,
    Table,
)
from wildshape.report.picture import still
from wildshape.report.scene import Scene, scene_of

_MAX_CURVE_POINTS = 2000
_DASH, _SPREAD = "\N{EN DASH}", " ± "
_NUMERIC = f"0123456789-+±{_DASH}"
_WIDE = 12  # columns from which a table is drawn smaller
_STEPS = 65534  # int16 from -32767 to 32767 across the scene


def write_report(report: Report, path: Path) -> None:
    """Write the page; its file appears, or is replaced, only when it is whole."""
    write_text(path, render(report))


def render(report: Report) -> str:
    """The page's text."""
    from plotly.offline import get_plotlyjs

    scenes = [scene_of(shown) for shown in report.objects]
    return Template(_template("page.html")).substitute(
        title=escape(report.title),
        summary=_paragraphs(report.summary),
        style=_texts(report, "page.css", "scene.css"),
        facts=_tiles(report.facts),
        scene=_scene_section(report.scene),
        stills=_stills(report, scenes),
        objects_hidden="" if report.objects else "hidden",
        cost=_section("Cost", _tiles(report.cost)),
        findings=_items(report.findings, " class=findings"),
        index="".join(_section(t.title, _html_table(t)) for t in report.index),
        tables="".join(_section(t.title, _html_table(t)) for t in report.tables),
        curves=_curves(report.curves),
        figures=_figures(report),
        notes=_section("Notes", _items(report.notes)),
        provenance=_provenance(report.provenance),
        data=_json(_data(report, scenes)),
        plotly=get_plotlyjs(),
        script=_texts(report, "page.js", "scene_drawing.js", "scene.js"),
    )


def _template(name: str) -> str:
    return (files("wildshape.report.page") / "template" / name).read_text(encoding="utf-8")


def _texts(report: Report, always: str, *of_scenes: str) -> str:
    """A part of the page, and what it needs for a scene."""
    return "".join(map(_template, (always, *of_scenes) if report.scene else (always,)))


def _scene_section(scene: SceneView | None) -> str:
    if scene is None:
        return ""
    picture = f'<img alt="the drive from above" src="{_embedded(scene.picture, "webp")}">'
    return Template(_template("scene.html")).substitute(picture=picture, scene=_json(scene.data))


def quantise(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[str, list[float]]:
    """Points as base64 of little-endian int16, and the metres of one step along each axis.

    `x = (q + 32767) step + low`; the error is at most half a step, that is 0.1 mm for 10 m.
    """
    step = (high - low) / _STEPS
    q = np.rint((points - low) / step) - 32767
    packed = np.clip(q, -32767, 32767).astype("<i2").tobytes()
    return base64.b64encode(packed).decode("ascii"), step.tolist()


def _data(report: Report, scenes: list[Scene]) -> dict:
    objects = [
        {
            "name": shown.name,
            "subtitle": shown.subtitle,
            "details": shown.details,
            **_scene(scene),
        }
        for shown, scene in zip(report.objects, scenes, strict=True)
    ]
    return {"objects": objects, "curves": [_curve(curve) for curve in report.curves]}


def _scene(scene: Scene) -> dict:
    return {
        "middle": scene.middle.tolist(),
        "extent": scene.extent,
        "low": scene.low.tolist(),
        "high": scene.high.tolist(),
        "box": scene.box.round(4).tolist(),
        "arrow": None if scene.arrow is None else scene.arrow.round(4).tolist(),
        "distance": round(scene.distance, 2),
        "clouds": [_cloud(cloud, scene) for cloud in scene.clouds],
    }


def _cloud(cloud: Cloud, scene: Scene) -> dict:
    packed, step = quantise(cloud.points, scene.low, scene.high)
    return {
        "label": cloud.label,
        "color": cloud.paint,
        "size": cloud.size,
        "count": len(cloud.points),
        "step": step,
        "points": packed,
    }


def _curve(curve: Curve) -> dict:
    series = [
        {
            "name": name,
            "x": _column(xs),
            "y": _column(ys),
            "color": SERIES_COLORS[i % len(SERIES_COLORS)],
        }
        for i, (name, xs, ys) in enumerate(curve.series)
    ]
    labels = {"title": curve.title, "x_label": curve.x_label, "y_label": curve.y_label}
    return {**labels, "log_y": curve.log_y, "series": series}


def _column(values: Numbers) -> list[float | None]:
    stride = max(1, math.ceil(len(values) / _MAX_CURVE_POINTS))
    thinned = (float(value) for value in values[::stride])
    return [float(f"{value:.6g}") if math.isfinite(value) else None for value in thinned]


def _json(data: dict) -> str:
    """JSON that cannot end its script element, whatever a name holds."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _paragraphs(text: str) -> str:
    parts = (part.strip() for part in text.split("\n\n"))
    return "".join(f"<p>{_prose(part)}</p>" for part in parts if part)


def _prose(text: str) -> str:
    """Text with its `commands` set apart."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def _section(title: str, body: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{body}</section>" if body else ""


def _tiles(tiles: tuple[tuple[str, str], ...]) -> str:
    parts = "".join(
        f"<div><dt>{escape(label)}</dt><dd>{escape(value)}</dd></div>" for label, value in tiles
    )
    return f'<dl class="tiles">{parts}</dl>' if tiles else ""


def _curves(curves: tuple[Curve, ...]) -> str:
    panels = "".join(
        f'<figure><figcaption>{escape(curve.title)}</figcaption><div id="curve{i}" class=curve>'
        "<noscript>JavaScript draws it.</noscript></div></figure>"
        for i, curve in enumerate(curves)
    )
    return _section("Training", f"<div class=grid>{panels}</div>" if panels else "")


def _figures(report: Report) -> str:
    images = "".join(map(_picture, report.figures))
    return _section("Figures", f"<div class=grid>{images}</div>" if images else "")


def _picture(figure: Figure) -> str:
    source = _embedded(figure.image, figure.kind)
    image = f'<img alt="{escape(figure.title)}" src="{source}">'
    if figure.to:
        image = f'<a href="{escape(figure.to)}">{image}</a>'
    wide = " class=wide" if figure.wide else ""
    return f"<figure{wide}><figcaption>{escape(figure.title)}</figcaption>{image}</figure>"


def _items(texts: tuple[str, ...], kind: str = "") -> str:
    items = "".join(f"<li>{_prose(text)}</li>" for text in texts)
    return f"<ul{kind}>{items}</ul>" if items else ""


def _stills(report: Report, scenes: list[Scene]) -> str:
    """A part for each object, shown on paper and where a browser has no WebGL.

    On a screen with WebGL the page takes the table of the object chosen from here.
    """
    return "".join(
        f"<figure><figcaption>{escape(shown.name)} <small>{escape(shown.subtitle)}</small>"
        f"</figcaption>{_still(shown, scene)}</figure>"
        for shown, scene in zip(report.objects, scenes, strict=True)
    )


def _still(shown: ReportObject, scene: Scene) -> str:
    image = (
        f'<img alt="{escape(shown.name)}" src="{_embedded(still(scene), "png")}">'
        if scene.clouds and shown.paper
        else ""
    )
    details = "; ".join(f"{label} {value}" for label, value in shown.details)
    table = f"<div class=scans>{_html_table(shown.scans)}</div>" if shown.scans else ""
    return f"{image}<p>{escape(details)}</p>{table}"


def _embedded(image: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(image).decode('ascii')}"


def _provenance(provenance: dict) -> str:
    rows = "".join(
        f"<dt>{escape(str(name))}</dt><dd>{escape(_readable(value))}</dd>"
        for name, value in provenance.items()
    )
    folded = f"<details><summary>Where this comes from</summary><dl>{rows}</dl></details>"
    return f"<section class=provenance>{folded}</section>" if rows else ""


def _readable(value: object) -> str:
    if isinstance(value, dict | list | tuple):
        return json.dumps(value, indent=1, default=str)
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def _html_table(table: Table) -> str:
    """With its caption, without its title; a sortable one is sorted by the page's script."""
    right = [i > 0 and _numeric([r[i] for r in table.rows]) for i in range(len(table.columns))]
    head = "".join(
        f"<th scope=col{_class(right[i])}>{escape(name)}</th>"
        for i, name in enumerate(table.columns)
    )
    rows = "".join(_table_row(table, i, right) for i in range(len(table.rows)))
    caption = f"<p class=caption>{escape(table.caption)}</p>" if table.caption else ""
    classes = ["sortable"] * table.sortable + ["wide"] * (len(table.columns) > _WIDE)
    kind = f' class="{" ".join(classes)}"' if classes else ""
    grid = f"<table{kind}><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return f"<div class=scroll>{grid}</div>{caption}"


def _table_row(table: Table, number: int, right: list[bool]) -> str:
    cells = "".join(
        f"<td{_class(is_right)}>{_content(cell)}</td>"
        for cell, is_right in zip(table.rows[number], right, strict=True)
    )
    ours = " class=ours" if number in table.emphasis else ""
    to = table.objects[number] if number < len(table.objects) else None
    return f"<tr{ours}{'' if to is None else f' data-object={to} tabindex=0'}>{cells}</tr>"


def _class(right: bool) -> str:
    return " class=number" if right else ""


def _numeric(cells: list[Cell]) -> bool:
    """Whether a column holds numbers, some perhaps written as `82.1 ± 1.3` or `–`."""
    return all(not isinstance(cell, str) or cell[:1] in _NUMERIC for cell in cells)


def _content(cell: Cell) -> str:
    """The text; a deviation may stand below its mean where the page is narrow."""
    text = escape(_text(cell))
    mean, spread, deviation = text.partition(_SPREAD)
    if spread and mean[:1] in _NUMERIC:
        return f"{mean} <small>± {deviation}</small>"
    return text


def _text(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return _DASH
    return format(cell, ".3g") if isinstance(cell, float) else str(cell)
