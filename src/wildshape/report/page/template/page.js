// SPDX-FileCopyrightText: 2026 The Wildshape developers
// SPDX-License-Identifier: Apache-2.0
// Linked 3D panels and curves. All drawing is plotly's; this only hands it data and one camera.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const bare = { displayModeBar: false, responsive: true, scrollZoom: false, plotGlPixelRatio: Math.max(1, devicePixelRatio) };
  const view = { azimuth: 0, elevation: 0, distance: 1 }; // radians, and cubes of plotly's scene
  const panels = []; // re-used from object to object: a browser keeps about 16 WebGL contexts
  let current = 0;

  const hash = (key) => new URLSearchParams(location.hash.slice(1)).get(key);
  const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  // plotly reads a little HTML in its texts; names are to be shown as they are
  const plain = (s) => s.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

  function mix(a, b, share) {
    const part = (hex, i) => parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16);
    const rgb = [0, 1, 2].map((i) => Math.round(part(a, i) * (1 - share) + part(b, i) * share));
    return "rgb(" + rgb + ")";
  }

  function decode(cloud, low) {
    const bytes = Uint8Array.from(atob(cloud.points), (c) => c.charCodeAt(0));
    const words = new DataView(bytes.buffer);
    const axes = [0, 1, 2].map(() => new Float32Array(cloud.count));
    for (let i = 0; i < 3 * cloud.count; i++) {
      const q = words.getInt16(2 * i, true) + 32767;
      axes[i % 3][Math.floor(i / 3)] = q * cloud.step[i % 3] + low[i % 3];
    }
    return axes;
  }

  // dots shrink with the panel: on a phone they would run together
  const dotScale = () => Math.max(0.6, Math.min(1.2, panels[0].plot.clientWidth / 330 || 1));
  const columns = (rows) => [0, 1, 2].map((axis) => rows.map((p) => p && p[axis]));
  const quiet = { hoverinfo: "skip", showlegend: false };

  function dots(cloud, low) {
    const [x, y, z] = decode(cloud, low);
    const shade = dark.matches ? [mix(cloud.color, "#000000", 0.35), mix(cloud.color, "#ffffff", 0.4)]
      : [mix(cloud.color, "#000000", 0.55), mix(cloud.color, "#ffffff", 0.12)];
    const marker = { size: cloud.size * dotScale(), color: z, line: { width: 0 },
      colorscale: [[0, shade[0]], [1, shade[1]]], showscale: false };
    return { type: "scatter3d", mode: "markers", x, y, z, marker, ...quiet };
  }

  function lines(segments, color, width) {
    const [x, y, z] = columns(segments.flatMap(([a, b]) => [a, b, null]));
    return { type: "scatter3d", mode: "lines", x, y, z, line: { color, width }, ...quiet };
  }

  function arrow(object) {
    const [a, b] = object.arrow;
    const along = b.map((v, i) => v - a[i]);
    const length = Math.hypot(...along);
    const one = (v) => [v];
    const head = { type: "cone", x: one(b[0]), y: one(b[1]), z: one(b[2]), u: one(along[0] / length),
      v: one(along[1] / length), w: one(along[2] / length), anchor: "tip", sizemode: "absolute",
      sizeref: length * 0.28, colorscale: [[0, ink("--ink")], [1, ink("--ink")]], showscale: false, ...quiet };
    const text = { type: "scatter3d", mode: "text", x: one((a[0] + b[0]) / 2), y: one((a[1] + b[1]) / 2), z: one((a[2] + b[2]) / 2),
      text: ["sensor"], textposition: "bottom center",
      textfont: { size: 12, color: ink("--ink") }, ...quiet };
    return [lines([[a, b]], ink("--ink"), 5), head, text];
  }

  function traces(object, i) {
    const all = [dots(object.clouds[i], object.low)];
    if ($("overlay").checked && i > 0) all.push(dots(object.clouds[0], object.low));
    if ($("show_box").checked && object.box.length) all.push(lines(object.box, ink("--soft"), 3));
    return i === 0 && object.arrow ? all.concat(arrow(object)) : all;
  }

  function camera() {
    const flat = view.distance * Math.cos(view.elevation);
    const { middle, low, high, extent } = data.objects[current];
    const [x, y, z] = middle.map((v, i) => (v - (low[i] + high[i]) / 2) / extent);
    return { up: { x: 0, y: 0, z: 1 }, center: { x, y, z },
      eye: { x: x + flat * Math.cos(view.azimuth), y: y + flat * Math.sin(view.azimuth),
        z: z + view.distance * Math.sin(view.elevation) } };
  }

  const gridStep = ({ extent }) => [0.1, 0.2, 0.5, 1, 2, 5, 10, 20].find((s) => extent / s <= 7) || extent / 5;

  function layout(object) {
    const span = object.high.map((v, i) => v - object.low[i]);
    const unit = object.extent; // plotly's unit of length: one object
    const step = gridStep(object);
    const axis = (i) => ({ range: [object.low[i], object.high[i]], dtick: step, title: { text: "" },
      showticklabels: false, gridcolor: ink("--grid"),
      showbackground: false, zeroline: false, showspikes: false, showline: false, ticks: "" });
    return { margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", showlegend: false,
      font: { color: ink("--ink") }, scene: { xaxis: axis(0), yaxis: axis(1), zaxis: axis(2),
        aspectmode: "manual", aspectratio: { x: span[0] / unit, y: span[1] / unit, z: span[2] / unit },
        camera: camera(), dragmode: false, hovermode: false } };
  }

  let asked = false;
  function turned() { // one redraw a frame, however fast the mouse is
    view.elevation = Math.max(-1.5, Math.min(1.5, view.elevation));
    view.distance = Math.max(0.35, Math.min(4, view.distance));
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      for (const p of panels) if (!p.box.hidden) Plotly.relayout(p.plot, { "scene.camera": camera() });
    });
  }

  function grip(plot) { // mouse, pen and touch alike; a vertical swipe on a phone scrolls the page
    const held = new Map();
    const spread = () => { const [a, b] = held.values(); return Math.hypot(a.x - b.x, a.y - b.y); };
    plot.addEventListener("pointerdown", (e) => {
      held.set(e.pointerId, { x: e.clientX, y: e.clientY });
      plot.setPointerCapture(e.pointerId);
    });
    plot.addEventListener("pointermove", (e) => {
      const last = held.get(e.pointerId);
      if (!last) return;
      const before = held.size === 2 ? spread() : 0;
      held.set(e.pointerId, { x: e.clientX, y: e.clientY });
      if (held.size === 2) view.distance *= before / Math.max(spread(), 1);
      else {
        view.azimuth -= (e.clientX - last.x) * 0.01;
        view.elevation += (e.clientY - last.y) * 0.01;
      }
      turned();
    });
    for (const end of ["pointerup", "pointercancel"]) plot.addEventListener(end, (e) => held.delete(e.pointerId));
    plot.addEventListener("wheel", (e) => {
      if (!e.ctrlKey && !e.metaKey) return;
      e.preventDefault();
      view.distance *= Math.exp(e.deltaY * 0.002);
      turned();
    }, { passive: false });
    plot.addEventListener("keydown", (e) => {
      const move = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
      if (!move) return;
      e.preventDefault();
      view.azimuth += move[0];
      view.elevation += move[1];
      turned();
    });
  }

  function panel(i) {
    if (panels[i]) return panels[i];
    const make = (tag, parent, name) => { const el = document.createElement(tag); el.className = name || "";
      parent.append(el); return el; };
    const box = make("div", $("panels"), "panel");
    const head = make("p", box);
    const made = { box, label: make("span", head), count: make("small", head), plot: make("div", box, "plot") };
    made.plot.tabIndex = 0;
    grip(made.plot);
    panels[i] = made;
    return made;
  }

  function arrange(count) {
    $("panels").style.setProperty("--columns", count > 5 ? Math.ceil(count / 2) : Math.max(count, 1));
    for (let i = 0; i < Math.max(count, 1); i++) panel(i).box.hidden = i >= count;
    panels.slice(count).forEach((p) => { p.box.hidden = true; });
  }

  function draw() {
    const object = data.objects[current];
    object.clouds.forEach((cloud, i) => {
      const p = panels[i];
      p.box.style.setProperty("--dot", cloud.color);
      p.label.textContent = cloud.label;
      p.count.textContent = cloud.count.toLocaleString("en");
      p.plot.setAttribute("aria-label", cloud.label + ", 3D, arrow keys turn it");
      Plotly.react(p.plot, traces(object, i), layout(object), bare);
      if (p.plot.clientWidth !== p.width) Plotly.Plots.resize(p.plot);
      p.width = p.plot.clientWidth;
    });
  }

  const towards = (o) => Math.atan2(-o.middle[1], -o.middle[0]); // to the sensor
  const presets = {
    "3/4": (o) => [o.arrow ? towards(o) + 0.5 : -0.9, 0.42],
    "from sensor": (o) => [o.arrow ? towards(o) : 0, 0.08],
    "behind": (o) => [(o.arrow ? towards(o) : 0) + Math.PI + 0.6, 0.42],
    "above": (o) => [-Math.PI / 2, 1.5],
  };
  function look(name) {
    [view.azimuth, view.elevation] = presets[name](data.objects[current]);
    const { clientWidth: w, clientHeight: h } = panels[0].plot; // the field of view is vertical
    view.distance = 1.5 * Math.max(1, (1.2 * h) / w);
  }

  function select(index) {
    current = index;
    const object = data.objects[index];
    $("name").textContent = object.name;
    $("subtitle").textContent = object.subtitle;
    $("overlay_label").hidden = object.clouds.length < 2;
    $("box_label").hidden = $("stub").hidden = !object.box.length;
    const range = object.arrow ? [["range", object.distance.toFixed(1) + " m"]] : [];
    $("details").replaceChildren(...[...range, ...object.details].map(([label, value]) => {
      const row = document.createElement("div");
      row.append(Object.assign(document.createElement("dt"), { textContent: label }),
        Object.assign(document.createElement("dd"), { textContent: value }));
      return row;
    }));
    scans(index);
    for (const row of document.querySelectorAll("tr[data-object]")) row.classList.toggle("chosen", Number(row.dataset.object) === index);
    [...$("picker").children].forEach((b, i) => b.setAttribute("aria-pressed", i === index));
    $("step").textContent = Number(gridStep(object).toPrecision(2)) + " m";
    arrange(object.clouds.length);
    look("3/4");
    draw();
  }

  function take(index) { // by the reader: the scene, if there is one, follows
    select(index);
    document.dispatchEvent(new CustomEvent("object", { detail: index }));
  }

  function scans(index) { // the table that is printed, shown here for the object chosen
    const table = document.querySelectorAll(".stills figure")[index]?.querySelector(".scans");
    $("scans").hidden = !table;
    if (!table) return;
    const copy = table.cloneNode(true);
    $("scans").lastElementChild.replaceChildren(copy);
    copy.querySelectorAll("table.sortable").forEach(sortable);
  }

  // what a cell is sorted by: its number, however it is written, else its text
  const worth = (cell) => {
    const text = cell.textContent.trim();
    const number = parseFloat(text.replace(/,/g, ""));
    return cell.classList.contains("number") ? (Number.isNaN(number) ? -Infinity : number) : text;
  };
  const compare = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));

  function sortable(table) {
    const body = table.tBodies[0];
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      head.tabIndex = 0;
      const sort = () => {
        const down = head.getAttribute("aria-sort") !== "descending";
        for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        const rows = [...body.rows].sort((a, b) => compare(worth(a.cells[column]), worth(b.cells[column])) * (down ? -1 : 1));
        body.append(...rows);
      };
      head.addEventListener("click", sort);
      head.addEventListener("keydown", (e) => { if (e.key === "Enter") sort(); });
    });
  }

  function filter(table) { // words that a row must hold; above tables that are worth it
    if (table.tBodies[0].rows.length < 6) return;
    const rows = [...table.tBodies[0].rows];
    const bar = Object.assign(document.createElement("div"), { className: "filter" });
    const field = Object.assign(document.createElement("input"), { type: "search", placeholder: "filter, for example a name" });
    field.setAttribute("aria-label", "filter the rows");
    const count = document.createElement("span");
    const apply = () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of rows) row.hidden = !words.every((w) => row.textContent.toLowerCase().includes(w));
      count.textContent = rows.filter((r) => !r.hidden).length + " of " + rows.length;
    };
    field.addEventListener("input", apply);
    bar.append(field, count);
    const scroll = table.closest(".scroll");
    scroll.before(bar);
    if (rows.length > 14) scroll.classList.add("long");
    apply();
  }

  function leads(row) { // to the object's pictures
    const go = () => { take(Number(row.dataset.object)); $("objects").scrollIntoView({ behavior: "smooth" }); };
    row.addEventListener("click", go);
    row.addEventListener("keydown", (e) => { if (e.key === "Enter") go(); });
  }

  function button(parent, text, act) {
    const b = Object.assign(document.createElement("button"), { type: "button", textContent: text, title: text });
    b.addEventListener("click", act);
    parent.append(b);
  }

  function webgl() {
    try { return !!document.createElement("canvas").getContext("webgl"); } catch { return false; }
  }

  function start() {
    data.objects.forEach((object, i) => button($("picker"), object.name, () => take(i)));
    document.addEventListener("vehicle", (e) => { if (data.objects[e.detail]) select(e.detail); });
    $("picker").hidden = data.objects.length < 2;
    for (const name of Object.keys(presets)) button($("views"), name, () => { look(name); turned(); });
    $("closer").addEventListener("click", () => { view.distance /= 1.2; turned(); });
    $("farther").addEventListener("click", () => { view.distance *= 1.2; turned(); });
    for (const id of ["show_box", "overlay"]) $(id).addEventListener("change", draw);
    select(Math.min(Math.max(Number(hash("object")) || 0, 0), data.objects.length - 1)); // #object=2
  }

  function curves() {
    data.curves.forEach((curve, i) => {
      const axis = (text) => ({ title: { text: plain(text), standoff: 8 }, gridcolor: ink("--grid"),
        zeroline: false, linecolor: ink("--line"), automargin: true });
      const lines = curve.series.map((s) => ({ type: "scatter", mode: s.x.length > 1 ? "lines" : "markers",
        x: s.x, y: s.y, name: plain(s.name), line: { color: dark.matches ? mix(s.color, "#ffffff", 0.3) : s.color, width: 2 } }));
      const heights = curve.series.flatMap((s) => s.y);
      const [low, high] = [Math.min, Math.max].map((of) => heights.reduce((a, b) => of(a, b)));
      const wide = high > 5 * low; // of 1, 2, 5, 10 a narrower span may hold none
      Plotly.react("curve" + i, lines, { margin: { l: 56, r: 12, t: 8, b: 44 }, hovermode: "x unified",
        paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", dragmode: false,
        hoverlabel: { bgcolor: ink("--card"), font: { color: ink("--ink") } },
        font: { color: ink("--ink"), family: "system-ui, sans-serif", size: 12 },
        showlegend: curve.series.length > 1, legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
        xaxis: axis(curve.x_label), yaxis: { ...axis(curve.y_label), type: curve.log_y ? "log" : "linear", rangemode: "nonnegative",
          dtick: curve.log_y && wide ? "D2" : undefined, tickformat: "~g" } }, bare);
    });
  }

  curves();
  for (const table of document.querySelectorAll("main > section:not(#objects) table.sortable")) { sortable(table); filter(table); }
  const alive = webgl();
  if (!alive) document.body.classList.add("no-webgl");
  if (alive && data.objects.length) {
    start();
    document.querySelectorAll("tr[data-object]").forEach(leads);
  }
  dark.addEventListener("change", () => { curves(); if (alive && data.objects.length) draw(); });
})();
