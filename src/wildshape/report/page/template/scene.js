// SPDX-FileCopyrightText: 2026 The Wildshape developers
// SPDX-License-Identifier: Apache-2.0
// A drive over time, drawn by WebGL itself: scans, boxes, completed shapes, the ways of all.
// The frame is the level world: x forward at the first frame, y left, z up, metres.
"use strict";
(() => {
  const element = document.getElementById("drive_data");
  if (!element) return;
  const data = JSON.parse(element.textContent);
  const $ = (id) => document.getElementById("drive_" + id);
  const canvas = $("canvas");
  const paper = drawing.on(canvas);
  if (!paper) return;
  const { half, times, rigid, upright, through, minus, dot } = drawing;
  const { buffer, cloud, drawDots, drawLines } = paper;

  const { frames, vehicles } = data;
  const view = { target: [0, 0, 0], azimuth: 0, elevation: 0, distance: 60 };
  const layers = [...document.querySelectorAll("#drive_layers input")];
  const on = (name) => layers.find((box) => box.dataset.layer === name).checked;
  let now = 0, chosen = -1, playing = false, began = 0, asked = false;

  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
  const palette = data.palette.map(rgb);
  const colour = (number) => palette[number % palette.length];
  const css = (number) => data.palette[number % palette.length];

  function axes() { // of the camera: to the right, up on the screen, backwards
    const { azimuth: a, elevation: e } = view;
    const back = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    const right = [-Math.sin(a), Math.cos(a), 0];
    const up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
    return { right, up, back };
  }
  const eye = () => { const { back } = axes(); return view.target.map((v, i) => v + view.distance * back[i]); };

  function camera() {
    const { right, up, back } = axes(), from = eye();
    const near = view.distance / 100, far = view.distance + 600, wide = canvas.width / canvas.height;
    const look = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, from), -dot(up, from), -dot(back, from), 1];
    const lens = [1 / (half * wide), 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, (far + near) / (near - far), -1,
      0, 0, (2 * far * near) / (near - far), 0];
    return times(lens, look);
  }

  // ---- the scene

  // points on vehicles come last and have a colour each; that array is made when first drawn
  function scanOf(i) {
    const frame = frames[i];
    if (!frame.cloud) {
      const on = frame.owners.length, first = frame.count - on;
      const paint = new Uint8Array(3 * on);
      frame.owners.forEach((o, k) => palette[o].forEach((v, c) => { paint[3 * k + c] = 255 * (0.45 * v + 0.55); }));
      frame.cloud = { ...cloud(frame), first, paint: buffer(paint) };
      frame.points = "";
    }
    return frame.cloud;
  }

  const here = (i) => through(rigid(frames[i].pose), [0, 0, 0]).slice(0, 3); // the sensor's place
  const seen = (number) => vehicles[number].places[now - vehicles[number].first];
  const signs = [0, 1].flatMap((x) => [0, 1].flatMap((y) => [0, 1].map((z) => [x - 0.5, y - 0.5, z - 0.5])));
  const edges = signs.flatMap((a, i) => signs.slice(0, i).flatMap((b, j) => (Math.abs(dot(minus(a, b), minus(a, b)) - 1) < 1e-9 ? [[i, j]] : [])));

  function boxLines(number) {
    const { size } = vehicles[number], m = upright(seen(number));
    const at = (p) => through(m, p.map((v, i) => v * size[i])).slice(0, 3);
    const paint = number === chosen ? [1, 1, 1] : colour(number);
    const ends = signs.map(at);
    const heading = [at([0.5, 0, -0.5]), at([0.5 + 1.2 / size[0], 0, -0.5])];
    return [...edges.map(([i, j]) => [ends[i], ends[j], paint, 1]), [...heading, paint, 1]];
  }

  function wayLines(places, paint, alpha) {
    const list = [];
    for (let i = 1; i < places.length; i++) if (places[i] && places[i - 1]) list.push([places[i - 1].slice(0, 3), places[i].slice(0, 3), paint, alpha]);
    return list;
  }

  const low = data.way.map((p) => [p[0], p[1], p[2] - data.ground + 0.05]); // on the road
  const bounds = [0, 1].map((i) => { const all = low.map((p) => p[i]); return [Math.min(...all) - 60, Math.max(...all) + 60].map((v) => 10 * Math.round(v / 10)); });
  const gridLines = (() => {
    const list = [], [x, y] = bounds, z = low[0][2] - 0.1;
    for (let v = x[0]; v <= x[1]; v += 10) list.push([[v, y[0], z], [v, y[1], z], [0.5, 0.6, 0.7], 0.16]);
    for (let v = y[0]; v <= y[1]; v += 10) list.push([[x[0], v, z], [x[1], v, z], [0.5, 0.6, 0.7], 0.16]);
    return list;
  })();

  function sensorLines() { // x red, y green, z blue
    const m = rigid(frames[now].pose), o = here(now);
    return [[[2.5, 0, 0], [0.95, 0.33, 0.3]], [[0, 2.5, 0], [0.35, 0.8, 0.4]], [[0, 0, 2.5], [0.4, 0.6, 1]]]
      .map(([tip, paint]) => [o, through(m, tip).slice(0, 3), paint, 1]);
  }

  const thinner = Math.max(2, frames.length / 10);
  function drawScans(m) {
    for (let i = 0; i < frames.length; i++) { // the others thinner: their points are shuffled
      if (i !== now && !on("all")) continue;
      const made = scanOf(i), rows = frames[i].pose, mine = times(m, rigid(rows));
      const up = [...rows[2].slice(0, 3), data.ground + rows[2][3] - here(i)[2]];
      drawDots(made, mine, { size: 0.1, count: i === now ? made.first : Math.ceil(made.first / thinner), up });
      if (i === now) drawDots(made, mine, { size: 0.12, from: made.first, count: made.count - made.first, painted: made.paint });
    }
  }

  function drawShapes(m) {
    vehicles.forEach((one, number) => {
      if (!seen(number)) return;
      one.cloud ||= cloud(one.shape);
      drawDots(one.cloud, times(m, upright(seen(number))), { size: 0.07, paint: colour(number).map((v) => 0.85 * v) });
    });
  }

  function draw() {
    asked = false;
    fit();
    if ($("follow").checked) view.target = minus(here(now), [0, 0, data.ground]);
    const m = camera();
    paper.begin();
    if (on("grid")) paper.behind(() => drawLines(gridLines, m, 1));
    if (on("scan")) drawScans(m);
    if (on("shapes")) drawShapes(m);
    if (on("ways")) {
      drawLines(wayLines(low, [1, 1, 1], 0.8), m, 2);
      vehicles.forEach((one, number) => { if (one.moving) drawLines(wayLines(one.places, colour(number), 0.75), m, 2); });
    }
    drawLines(sensorLines(), m, 3.5);
    const there = vehicles.map((_, number) => number).filter(seen);
    if (on("boxes")) drawLines(there.flatMap((n) => (n === chosen ? [] : boxLines(n))), m, 1.8);
    if (chosen >= 0 && seen(chosen)) drawLines(boxLines(chosen), m, 3.5);
    names(m, there);
    scale();
  }
  function redraw() { if (!asked) { asked = true; requestAnimationFrame(draw); } }

  function fit() {
    const dense = devicePixelRatio || 1, w = Math.round(canvas.clientWidth * dense), h = Math.round(canvas.clientHeight * dense);
    if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  }

  // ---- what is written over it

  function names(m, there) {
    const shown = [...there.map((n) => [vehicles[n].name, css(n), [seen(n)[0], seen(n)[1], seen(n)[2] + vehicles[n].size[2] / 2 + 0.5], n]),
      ["sensor", "#ffffff", minus(here(now), [0, 0, -1.2]), -2]];
    const taken = [];
    shown.sort((a, b) => (b[3] === chosen) - (a[3] === chosen));
    $("labels").replaceChildren(...(on("names") ? shown : shown.filter(([, , , n]) => n === chosen && n >= 0)).flatMap(([text, paint, at, n]) => {
      const p = through(m, at);
      const x = (p[0] / p[3] + 1) / 2 * canvas.clientWidth, y = (1 - p[1] / p[3]) / 2 * canvas.clientHeight, w = 7 * text.length + 12;
      if (p[3] <= 0 || x < 0 || y < 0 || x > canvas.clientWidth || y > canvas.clientHeight) return [];
      if (taken.some(([u, v, other]) => Math.abs(u - x) < (w + other) / 2 && Math.abs(v - y) < 17)) return [];
      taken.push([x, y, w]);
      const label = Object.assign(document.createElement("span"), { textContent: text, className: n === chosen ? "chosen" : "" });
      label.style.color = paint;
      label.style.transform = `translate(clamp(0px, ${x}px - 50%, ${canvas.clientWidth}px - 100%), ${y}px) translateY(-100%)`;
      return [label];
    }));
  }

  function scale() { // a bar of a round length, true in the middle of the picture
    const metres = (2 * half * view.distance) / canvas.clientHeight; // a pixel
    const length = [1, 2, 5, 10, 20, 50, 100].find((v) => v / metres > 70) || 200;
    $("scale").firstElementChild.style.width = length / metres + "px";
    $("scale").lastElementChild.textContent = length + " m";
  }

  function write() {
    const frame = frames[now];
    $("time").value = now;
    const last = frames.at(-1);
    $("now").textContent = data.timed ? `frame ${frame.frame}, ${frame.time.toFixed(1)} of ${last.time.toFixed(1)} s` : `frame ${frame.frame} of ${last.frame}`;
    card();
  }

  function card() {
    const box = $("card"), one = vehicles[chosen];
    box.hidden = !one;
    if (!one) return;
    const place = seen(chosen), at = now - one.first, make = (tag, text) => Object.assign(document.createElement(tag), { textContent: text });
    const away = place && Math.hypot(...minus(place.slice(0, 3), here(now)));
    const list = [["size", one.size.map((v) => v.toFixed(2)).join(" × ") + " m"], ["confidence", one.confidence.toFixed(2)],
      ...Object.entries(one.chances).map(([label, chance]) => [label, chance.toFixed(2)]),
      ["motion", one.moving ? "moving" : "standing"], ...(place ? [["distance", away.toFixed(1) + " m"], ["points in scan", one.points[at].toLocaleString("en")]] : [["", "not in this frame"]]),
      ...(one.moving && place && one.speeds ? [["speed", one.speeds[at].toFixed(1) + " m/s"]] : [])];
    const table = document.createElement("dl");
    for (const [label, value] of list) table.append(make("dt", label), make("dd", value));
    const open = make("button", "its shape and scans ↓");
    open.type = "button";
    open.addEventListener("click", () => document.getElementById("objects").scrollIntoView({ behavior: "smooth" }));
    box.style.setProperty("--dot", css(chosen));
    box.replaceChildren(make("h3", one.name), table, open);
  }

  // ---- what the reader does

  function go(to) { now = Math.max(0, Math.min(frames.length - 1, to)); write(); redraw(); }
  function seek(to) { go(to); clock(); } // by the reader: what plays goes on from there
  function clock() { began = performance.now() - frames[now].time / rate() * 1000; }

  function choose(number, told = true) {
    chosen = number;
    if (number >= 0 && !seen(number)) { // to when it is best seen
      const { first, points } = vehicles[number];
      now = first + points.indexOf(Math.max(...points));
      clock();
    }
    if (number >= 0 && told) document.dispatchEvent(new CustomEvent("vehicle", { detail: number }));
    write();
    redraw();
  }

  function pick(x, y) { // the nearest box on the ray through a pixel
    const { right, up, back } = axes(), from = eye(), box = canvas.getBoundingClientRect();
    const u = ((x - box.left) / box.width * 2 - 1) * half * box.width / box.height, v = (1 - (y - box.top) / box.height * 2) * half;
    const ray = [0, 1, 2].map((i) => right[i] * u + up[i] * v - back[i]);
    let best = -1, nearest = Infinity;
    vehicles.forEach((one, number) => {
      const place = seen(number);
      if (!place) return;
      const c = Math.cos(place[3]), s = Math.sin(place[3]);
      const turn = ([p, q, r]) => [c * p + s * q, c * q - s * p, r];
      const o = turn(minus(from, place.slice(0, 3))), d = turn(ray);
      let enter = 0, leave = Infinity;
      one.size.forEach((side, i) => {
        const reach = side / 2 + 0.3, [a, b] = [(-reach - o[i]) / d[i], (reach - o[i]) / d[i]].sort((p, q) => p - q);
        enter = Math.max(enter, a);
        leave = Math.min(leave, b);
      });
      if (enter < leave && enter < nearest) [best, nearest] = [number, enter];
    });
    return best;
  }

  const held = new Map();
  let strayed = 0;
  function handle() {
    const spread = () => { const [a, b] = held.values(); return Math.hypot(a.x - b.x, a.y - b.y); };
    canvas.addEventListener("pointerdown", (e) => { held.set(e.pointerId, { x: e.clientX, y: e.clientY }); strayed = 0; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointermove", (e) => {
      const last = held.get(e.pointerId);
      if (!last) return;
      const before = held.size === 2 ? spread() : 0, dx = e.clientX - last.x, dy = e.clientY - last.y;
      strayed += Math.abs(dx) + Math.abs(dy);
      held.set(e.pointerId, { x: e.clientX, y: e.clientY });
      if (held.size === 2) zoom(before / Math.max(spread(), 1));
      else if (e.shiftKey || e.buttons === 2) slide(dx, dy);
      else turn(dx, dy);
    });
    canvas.addEventListener("pointerup", (e) => { held.delete(e.pointerId); if (strayed < 5) choose(pick(e.clientX, e.clientY)); });
    canvas.addEventListener("pointercancel", (e) => held.delete(e.pointerId));
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => { if (e.ctrlKey || e.metaKey) { e.preventDefault(); zoom(Math.exp(e.deltaY * 0.002)); } }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      const act = { ArrowLeft: () => seek(now - 1), ArrowRight: () => seek(now + 1), " ": toggle, Escape: () => choose(-1) }[e.key];
      if (act) { e.preventDefault(); act(); }
    });
  }
  function turn(dx, dy) {
    view.azimuth -= dx * 0.006;
    view.elevation = Math.max(0.03, Math.min(Math.PI / 2, view.elevation + dy * 0.006));
    redraw();
  }
  function slide(dx, dy) { // over the ground, the point under the pointer stays there
    const { right } = axes(), a = view.azimuth, metres = (2 * half * view.distance) / canvas.clientHeight;
    const far = [-Math.cos(a), -Math.sin(a)], steep = Math.max(0.25, Math.sin(view.elevation));
    $("follow").checked = false;
    view.target = view.target.map((v, i) => v + (i < 2 ? metres * (-dx * right[i] + (dy / steep) * far[i]) : 0));
    redraw();
  }
  function zoom(by) { view.distance = Math.max(4, Math.min(800, view.distance * by)); redraw(); }

  function toggle() {
    playing = !playing;
    $("play").textContent = playing ? "⏸" : "▶";
    if (playing && now === frames.length - 1) now = 0;
    clock();
    if (playing) requestAnimationFrame(step);
  }
  const rate = () => Number($("speed").value);
  function step(moment) {
    if (!playing) return;
    const at = (moment - began) / 1000 * rate();
    let to = now;
    while (to < frames.length - 1 && frames[to + 1].time <= at) to++;
    if (to !== now) go(to);
    if (now === frames.length - 1) toggle();
    else requestAnimationFrame(step);
  }

  function look(elevation, azimuth, distance) {
    Object.assign(view, { elevation, azimuth, distance });
    redraw();
  }
  const middle = () => { // of the way and the vehicles
    const all = [...data.way, ...vehicles.flatMap((one) => [one.places.find(Boolean), one.places.findLast(Boolean)]).filter(Boolean)];
    const ends = [0, 1].map((i) => { const v = all.map((p) => p[i]); return [Math.min(...v), Math.max(...v)]; });
    const wide = canvas.clientWidth / canvas.clientHeight;
    const along = Math.atan2(...minus(data.way.at(-1), data.way[0]).slice(0, 2).reverse());
    return { all, target: [...ends.map(([a, b]) => (a + b) / 2), low[0][2]], along: Math.hypot(...minus(data.way.at(-1), data.way[0])) > 5 ? along : 0,
      span: Math.max((ends[0][1] - ends[0][0]) / wide, ends[1][1] - ends[1][0]) + 16 };
  };
  const nearest = (places) => { // that shows all of them, with 3 m around; of a long drive what is about its middle
    const { right, up, back } = axes(), wide = canvas.clientWidth / canvas.clientHeight;
    const needed = ([x, y]) => { const p = minus([x, y, view.target[2]], view.target);
      return dot(back, p) + Math.max((Math.abs(dot(right, p)) + 3) / wide, Math.abs(dot(up, p)) + 3) / half; };
    return Math.min(90 / Math.min(1, wide), Math.max(...places.map(needed)));
  };
  const presets = {
    "above": () => { const { target, span } = middle(); view.target = target; $("follow").checked = false; look(Math.PI / 2, -Math.PI / 2, span / (2 * half)); },
    "3/4": () => { const { all, target, along } = middle(); $("follow").checked = false; Object.assign(view, { target, elevation: 0.55, azimuth: along + Math.PI + 0.35 }); look(view.elevation, view.azimuth, nearest(all)); },
    "behind the sensor": () => { const m = frames[now].pose; $("follow").checked = true; look(0.3, Math.atan2(m[1][0], m[0][0]) + Math.PI, 24); },
  };

  function start() {
    $("time").max = frames.length - 1;
    $("time").addEventListener("input", () => seek(Number($("time").value)));
    $("play").addEventListener("click", toggle);
    $("speed").addEventListener("change", clock);
    $("closer").addEventListener("click", () => zoom(1 / 1.25));
    $("farther").addEventListener("click", () => zoom(1.25));
    for (const box of [...layers, $("follow")]) box.addEventListener("change", redraw);
    for (const [name, act] of Object.entries(presets)) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
      button.addEventListener("click", act);
      $("views").append(button);
    }
    $("legend").innerHTML = "<b>white way</b> sensor; its axes: <b style='color:#f2554d'>x</b> forward, <b style='color:#59cc66'>y</b> left, <b style='color:#6699ff'>z</b> up<br><b>bright dots</b> measured on a vehicle, <b>strong dots</b> its completed shape; the stub is its front";
    document.addEventListener("object", (e) => choose(e.detail, false));
    addEventListener("resize", redraw);
    handle();
    fit();
    go(Math.floor(frames.length / 2));
    presets["3/4"]();
  }
  start();
})();
