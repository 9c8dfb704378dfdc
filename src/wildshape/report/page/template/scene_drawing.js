// SPDX-FileCopyrightText: 2026 The Wildshape developers
// SPDX-License-Identifier: Apache-2.0
// Dots and wide lines by WebGL itself, and the little algebra that a camera needs.
"use strict";
const drawing = (() => {
  // ---- matrices, column by column as WebGL has them

  function times(a, b) {
    const out = new Array(16).fill(0);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    return out;
  }
  const rigid = (rows) => [0, 1, 2, 3].flatMap((c) => [rows[0][c], rows[1][c], rows[2][c], c === 3 ? 1 : 0]);
  function upright([x, y, z, yaw]) {
    const c = Math.cos(yaw), s = Math.sin(yaw);
    return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, x, y, z, 1];
  }
  const through = (m, p) => [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
  const minus = (a, b) => a.map((v, i) => v - b[i]);
  const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const half = Math.tan((40 * Math.PI) / 360); // half the vertical field of view

  function on(canvas) { // what draws there; nothing where there is no WebGL
    const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) return null;
    // ---- what the graphics card draws

    function program(vertex, fragment) {
      const made = gl.createProgram();
      for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, "precision mediump float;" + fragment]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
        gl.attachShader(made, shader);
      }
      gl.linkProgram(made);
      const place = (name) => gl.getUniformLocation(made, name);
      return { made, place, at: (name) => gl.getAttribLocation(made, name) };
    }

    // points: quantised by 65534 steps; shade: by height above the ground, or by the vehicle
    const dots = program(`
      attribute vec3 q; attribute vec3 paint; uniform mat4 m; uniform vec3 low, step; uniform vec4 up;
      uniform float size, own, dense; varying vec3 shade;
      void main() {
        vec3 p = (q + 32767.0) * step + low;
        gl_Position = m * vec4(p, 1.0);
        gl_PointSize = clamp(size / gl_Position.w, 1.8 * dense, 9.0 * dense);
        float h = dot(up.xyz, p) + up.w;
        vec3 high = mix(vec3(.38, .49, .59), vec3(.78, .84, .87), clamp((h - .3) / 5.0, 0.0, 1.0));
        vec3 lie = mix(vec3(.25, .30, .36), high, smoothstep(.1, .4, h));
        shade = mix(lie, paint, own);
      }`, "varying vec3 shade; void main() { vec2 d = gl_PointCoord - .5; if (dot(d, d) > .25) discard; gl_FragColor = vec4(shade, 1.0); }");
    // lines as wide as said, in pixels: each segment is two triangles
    const lines = program(`
      attribute vec3 a, b; attribute vec2 corner; attribute vec4 paint; uniform mat4 m; uniform vec2 screen; uniform float wide;
      varying vec4 shade;
      void main() {
        vec4 s = m * vec4(a, 1.0), e = m * vec4(b, 1.0);
        if (s.w < .01) s = mix(s, e, (.02 - s.w) / (e.w - s.w));
        if (e.w < .01) e = mix(e, s, (.02 - e.w) / (s.w - e.w));
        vec2 along = (e.xy / e.w - s.xy / s.w) * screen;
        vec2 side = length(along) > 1e-6 ? normalize(vec2(-along.y, along.x)) : vec2(0.0, 1.0);
        gl_Position = mix(s, e, corner.x);
        gl_Position.xy += side * corner.y * wide / screen * gl_Position.w;
        shade = paint;
      }`, "varying vec4 shade; void main() { gl_FragColor = shade; }");

    function buffer(values, kind = gl.STATIC_DRAW, made = gl.createBuffer()) {
      gl.bindBuffer(gl.ARRAY_BUFFER, made);
      gl.bufferData(gl.ARRAY_BUFFER, values, kind);
      return made;
    }

    function cloud(packed) {
      const { count, low, step } = packed;
      return { count, low, step, points: buffer(bytes(packed.points)) };
    }

    function drawDots(made, m, { size, paint, painted, from = 0, count = made.count, up = [0, 0, 1, 0] }) {
      if (count <= 0) return;
      gl.useProgram(dots.made);
      gl.uniformMatrix4fv(dots.place("m"), false, m);
      gl.uniform3fv(dots.place("low"), made.low);
      gl.uniform3fv(dots.place("step"), made.step);
      gl.uniform4fv(dots.place("up"), up);
      gl.uniform1f(dots.place("size"), size * canvas.height / (2 * half));
      gl.uniform1f(dots.place("dense"), devicePixelRatio || 1);
      gl.uniform1f(dots.place("own"), paint || painted ? 1 : 0);
      const q = dots.at("q"), c = dots.at("paint");
      gl.bindBuffer(gl.ARRAY_BUFFER, made.points);
      gl.enableVertexAttribArray(q);
      gl.vertexAttribPointer(q, 3, gl.SHORT, false, 6, 6 * from);
      if (painted) {
        gl.bindBuffer(gl.ARRAY_BUFFER, painted);
        gl.enableVertexAttribArray(c);
        gl.vertexAttribPointer(c, 3, gl.UNSIGNED_BYTE, true, 3, 0);
      } else {
        gl.disableVertexAttribArray(c);
        gl.vertexAttrib3fv(c, paint || [1, 1, 1]);
      }
      gl.drawArrays(gl.POINTS, 0, count);
    }

    const corners = [[0, -1], [1, -1], [1, 1], [0, -1], [1, 1], [0, 1]];
    function segments(list) { // of [a, b, colour, opacity]
      const out = new Float32Array(list.length * 72);
      let i = 0;
      for (const [a, b, paint, alpha] of list) {
        for (const corner of corners) { out.set(a, i); out.set(b, i + 3); out.set(corner, i + 6); out.set(paint, i + 8); out[i + 11] = alpha; i += 12; }
      }
      return out;
    }

    const scratch = gl.createBuffer();
    function drawLines(list, m, wide) {
      if (!list.length) return;
      gl.useProgram(lines.made);
      gl.uniformMatrix4fv(lines.place("m"), false, m);
      gl.uniform2f(lines.place("screen"), canvas.width / 2, canvas.height / 2);
      gl.uniform1f(lines.place("wide"), wide * (devicePixelRatio || 1) / 2);
      buffer(segments(list), gl.STREAM_DRAW, scratch);
      for (const [name, size, offset] of [["a", 3, 0], ["b", 3, 3], ["corner", 2, 6], ["paint", 4, 8]]) {
        gl.enableVertexAttribArray(lines.at(name));
        gl.vertexAttribPointer(lines.at(name), size, gl.FLOAT, false, 48, 4 * offset);
      }
      gl.drawArrays(gl.TRIANGLES, 0, 6 * list.length);
      for (const name of ["a", "b", "corner", "paint"]) gl.disableVertexAttribArray(lines.at(name));
    }

    function begin() {
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0.07, 0.09, 0.118, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    }
    function behind(act) { // what hides nothing
      gl.depthMask(false);
      act();
      gl.depthMask(true);
    }
    return { begin, behind, buffer, cloud, drawDots, drawLines };
  }
  return { on, half, times, rigid, upright, through, minus, dot };
})();
