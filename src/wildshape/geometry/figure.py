# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A shape and its box as one interactive 3D figure, whole in itself: for notebooks and browsers."""

import base64
import gzip
import os
import tempfile
import webbrowser
from html import escape
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.geometry.box import EDGES

_HEIGHT, _GREY = 480, "#8a8f98"
# The page is mostly plotly's script, 4.8 MB; a browser unpacks it from 2 MB.
_UNPACK = """<!DOCTYPE html><meta charset="utf-8"><script>
const packed = Uint8Array.from(atob("{}"), c => c.charCodeAt(0));
const page = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
new Response(page).text().then(text => {{
  document.open(); document.write(text); document.close(); document.body.style.margin = 0;
}});
</script>"""


def embedded(
    points: Float[np.ndarray, "n 3"], corners: Float[np.ndarray, "8 3"], title: str
) -> str:
    """The figure as an HTML element that needs neither network nor what surrounds it.

    Args:
        points: of the shape, metres.
        corners: of its box, in the order of `Box.corners`, in the points' frame.
        title: shown above it.
    """
    page = escape(_page(points, corners, title))
    style = f"width: 100%; height: {_HEIGHT}px; border: none"
    return f'<iframe srcdoc="{page}" style="{style}"></iframe>'


def opened(points: Float[np.ndarray, "n 3"], corners: Float[np.ndarray, "8 3"], title: str) -> Path:
    """The figure as a temporary file, opened in the browser; arguments as of `embedded`."""
    handle, name = tempfile.mkstemp(prefix="wildshape-", suffix=".html")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(_page(points, corners, title))
    webbrowser.open(Path(name).as_uri())
    return Path(name)


def _page(points: np.ndarray, corners: np.ndarray, title: str) -> str:
    bare = {"displayModeBar": False, "responsive": True}
    html = _figure(points, corners, title).to_html(config=bare, default_height="100vh")
    return _UNPACK.format(base64.b64encode(gzip.compress(html.encode(), mtime=0)).decode())


def _figure(points: np.ndarray, corners: np.ndarray, title: str) -> Any:
    """Seen from ahead, left and above, as the box has them, whatever the frame's axes."""
    from plotly import graph_objects as go

    ahead, left, up = ((corners[i] - corners[0]) for i in (4, 2, 1))
    ahead, left, up = (part / max(np.linalg.norm(part), 1e-9) for part in (ahead, left, up))
    marker = {"size": 2, "color": points @ up, "colorscale": "Viridis"}
    shape = go.Scatter3d(**_axes(points), mode="markers", marker=marker, hoverinfo="skip")
    edges = np.insert(corners[np.array(EDGES)], 2, np.nan, axis=1).reshape(-1, 3)
    line = {"color": _GREY, "width": 3}
    box = go.Scatter3d(**_axes(edges), mode="lines", line=line, hoverinfo="skip")
    axes = {f"{name}axis_title": f"{name}, m" for name in "xyz"}
    camera = {"up": _xyz(up), "eye": _xyz(1.3 * ahead + 1.3 * left + 0.9 * up)}
    figure = go.Figure((shape, box))
    figure.update_layout(
        title={"text": "<br>".join(map(escape, wrap(title))), "font": {"size": 13}, "x": 0.01},
        scene={"aspectmode": "data", "camera": camera, **axes},
        margin={"l": 0, "r": 0, "t": 60, "b": 0},
        showlegend=False,
    )
    return figure


def _axes(points: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip("xyz", np.asarray(points, np.float32).T, strict=True))


def _xyz(vector: np.ndarray) -> dict[str, float]:
    return dict(zip("xyz", vector.tolist(), strict=True))
