"use strict";
// The surface beside its image in the plane. Data in, one canvas with two viewports out; what
// is under the pointer is found by looking at every face, which is fast enough for a million.

const about = JSON.parse(document.getElementById("about").textContent);
const byId = (id) => document.getElementById(id);

async function unpack() {
  const packed = Uint8Array.from(atob(byId("data").textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const total = bytes.length / 4, arrays = {};
  let at = 0;
  for (const [name, length] of about.arrays) {
    const array = (arrays[name] = new Int32Array(length));
    let sum = 0;
    for (let i = 0; i < length; i++, at++) { // four planes of bytes; differences, sign last
      const z = bytes[at] | (bytes[total + at] << 8) | (bytes[2 * total + at] << 16) | (bytes[3 * total + at] << 24);
      array[i] = sum += (z >>> 1) ^ -(z & 1);
    }
  }
  return arrays;
}

// -- the scene -------------------------------------------------------------------------

function makeScene(arrays) {
  const n = arrays.x.length, m = arrays.faces.length / 3, F = arrays.faces;
  const P = new Float32Array(3 * n), UV = new Float32Array(2 * n), N = new Float32Array(3 * n);
  for (let i = 0; i < n; i++) {
    P[3 * i] = arrays.x[i] / 32767.5 - about.extent[0];
    P[3 * i + 1] = arrays.y[i] / 32767.5 - about.extent[1];
    P[3 * i + 2] = arrays.z[i] / 32767.5 - about.extent[2];
    UV[2 * i] = arrays.u[i] / 32767.5 - 1;
    UV[2 * i + 1] = arrays.v[i] / 32767.5 - 1;
  }
  for (let f = 0; f < m; f++) {
    const [i, j, k] = [3 * F[3 * f], 3 * F[3 * f + 1], 3 * F[3 * f + 2]];
    const ax = P[j] - P[i], ay = P[j + 1] - P[i + 1], az = P[j + 2] - P[i + 2];
    const bx = P[k] - P[i], by = P[k + 1] - P[i + 1], bz = P[k + 2] - P[i + 2];
    const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
    for (const c of [i, j, k]) { N[c] += x; N[c + 1] += y; N[c + 2] += z; }
  }
  let radius = 0;
  for (let i = 0; i < 3 * n; i += 3) radius = Math.max(radius, Math.hypot(P[i], P[i + 1], P[i + 2]));
  for (let i = 0; i < 3 * n; i++) P[i] /= radius;
  return { n, m, F, P, UV, N, rim: arrays.rim, cut: arrays.cut, arrays };
}

const VERTEX = `#version 300 es
in vec3 position, normal; in vec2 uv; in float value;
uniform mat3 turn; uniform vec2 shift, aspect; uniform float zoom; uniform bool plane;
out vec3 n; out vec2 at; out float x;
void main() {
  vec3 p = turn * (plane ? vec3(uv, 0) : position);
  gl_Position = vec4((p.xy * zoom + shift) * aspect, -0.9 * p.z, 1);
  n = normal; at = uv; x = value;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 n; in vec2 at; in float x;
uniform mat3 turn, home; uniform bool plane; uniform int kind; uniform float squares;
uniform vec3 ramp[9]; uniform sampler2D image; uniform vec2 origin;
out vec4 color;
// Mean of a square wave of period 2 over a width w: the difference of its integral.
float integral(float t) { return abs(mod(t, 2.0) - 1.0); }
float wave(float t, float w) { return (integral(t + w / 2.0) - integral(t - w / 2.0)) / w; }
void main() {
  vec3 unit = normalize(n);
  vec3 base;
  if (kind == 0) base = 0.5 + 0.5 * (home * unit);
  else if (kind == 1) {
    vec2 c = at * squares / 2.0, w = max(fwidth(c), 1e-6);
    float light = 0.5 + 0.5 * wave(c.x, w.x) * wave(c.y, w.y);
    base = mix(vec3(0.16, 0.30, 0.47), vec3(0.96, 0.94, 0.89), light);
  } else if (kind == 2) {
    float t = clamp(x, 0.0, 1.0) * 8.0; int i = min(int(t), 7);
    base = mix(ramp[i], ramp[i + 1], t - float(i));
  } else base = texture(image, vec2(origin.x + 0.5 * at.x, 1.0 - origin.y - 0.5 * at.y)).rgb;
  if (!plane) {
    vec3 seen = turn * unit;
    float back = gl_FrontFacing ? 1.0 : 0.62;
    vec3 key = normalize(vec3(-0.35, 0.5, 0.79));
    float light = 0.52 + 0.55 * max(dot(gl_FrontFacing ? seen : -seen, key), 0.0);
    base = base * light * back + 0.05 * pow(max(dot(reflect(-key, seen), vec3(0, 0, 1)), 0.0), 24.0);
  }
  color = vec4(base, 1);
}`;

// An edge is a rectangle as wide as a pen, a little in front of the surface.
const PEN = `#version 300 es
in vec3 startPoint, endPoint; in vec2 startUv, endUv;
uniform mat3 turn; uniform vec2 shift, aspect, pixel; uniform float zoom, width; uniform bool plane;
void main() {
  vec3 a = turn * (plane ? vec3(startUv, 0) : startPoint), b = turn * (plane ? vec3(endUv, 0) : endPoint);
  vec2 A = (a.xy * zoom + shift) * aspect, B = (b.xy * zoom + shift) * aspect;
  vec2 along = (B - A) / pixel; float length_ = length(along);
  along = length_ > 0.0 ? along / length_ : vec2(1, 0);
  bool end = gl_VertexID > 1; float side = gl_VertexID % 2 == 0 ? -1.0 : 1.0;
  vec2 moved = (vec2(-along.y, along.x) * side + along * (end ? 1.0 : -1.0) * 0.5) * width / 2.0 * pixel;
  gl_Position = vec4((end ? B : A) + moved, -0.9 * (end ? b.z : a.z) - 0.004, 1);
}`;
const INK = `#version 300 es
precision mediump float; uniform vec4 ink; out vec4 color; void main() { color = ink; }`;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const name = gl.getActiveUniform(made, i).name;
    uniforms[name.replace("[0]", "")] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms, attribute: (name) => gl.getAttribLocation(made, name) };
}

function attach(gl, location, size, data, divisor = 0, stride = 0, offset = 0) {
  if (location < 0) return;
  if (data) {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  }
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, size, gl.FLOAT, false, stride, offset);
  gl.vertexAttribDivisor(location, divisor);
}

function strokes(gl, pen, scene, ends) { // pairs of vertices as instances of a rectangle
  const data = new Float32Array(5 * ends.length);
  ends.forEach((i, k) => data.set([...scene.P.subarray(3 * i, 3 * i + 3), ...scene.UV.subarray(2 * i, 2 * i + 2)], 5 * k));
  const array = gl.createVertexArray(), buffer = gl.createBuffer();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  attach(gl, pen.attribute("startPoint"), 3, null, 1, 40, 0);
  attach(gl, pen.attribute("startUv"), 2, null, 1, 40, 12);
  attach(gl, pen.attribute("endPoint"), 3, null, 1, 40, 20);
  attach(gl, pen.attribute("endUv"), 2, null, 1, 40, 32);
  const free = () => { gl.deleteVertexArray(array); gl.deleteBuffer(buffer); };
  return { array, count: ends.length / 2, free };
}

// -- geometry --------------------------------------------------------------------------

const product = (a, b) => { // 3 x 3, by rows
  const c = new Float32Array(9);
  for (let i = 0; i < 9; i++) for (let k = 0; k < 3; k++) c[i] += a[3 * Math.floor(i / 3) + k] * b[3 * k + (i % 3)];
  return c;
};
const aboutZ = (t) => [Math.cos(t), -Math.sin(t), 0, Math.sin(t), Math.cos(t), 0, 0, 0, 1];
const aboutY = (t) => [Math.cos(t), 0, Math.sin(t), 0, 1, 0, -Math.sin(t), 0, Math.cos(t)];
const aboutX = (t) => [1, 0, 0, 0, Math.cos(t), -Math.sin(t), 0, Math.sin(t), Math.cos(t)];
const times = (turn, P, i) => [0, 3, 6].map((r) => turn[r] * P[i] + turn[r + 1] * P[i + 1] + turn[r + 2] * P[i + 2]);

// The nearest face at (x, y) among vertices (X, Y, Z), with barycentric coordinates.
function faceAt(F, X, Y, Z, x, y) {
  let best = null;
  for (let f = 0, c = 0; c < F.length; f++, c += 3) {
    const i = F[c], j = F[c + 1], k = F[c + 2];
    const ax = X[i] - x, ay = Y[i] - y, bx = X[j] - x, by = Y[j] - y, cx = X[k] - x, cy = Y[k] - y;
    const p = bx * cy - by * cx, q = cx * ay - cy * ax, r = ax * by - ay * bx, total = p + q + r;
    if (total === 0 || (p > 0 || q > 0 || r > 0) && (p < 0 || q < 0 || r < 0)) continue;
    const depth = Z ? (p * Z[i] + q * Z[j] + r * Z[k]) / total : 0;
    if (!best || depth > best.depth) best = { face: f, weights: [p / total, q / total, r / total], depth };
  }
  return best;
}

// -- the page --------------------------------------------------------------------------

function start(scene, gl, image) {
  const canvas = byId("canvas");
  const paint = program(gl, VERTEX, FRAGMENT), pen = program(gl, PEN, INK);
  const surface = gl.createVertexArray();
  gl.bindVertexArray(surface);
  attach(gl, paint.attribute("position"), 3, scene.P);
  attach(gl, paint.attribute("normal"), 3, scene.N);
  attach(gl, paint.attribute("uv"), 2, scene.UV);
  const values = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, values);
  gl.bufferData(gl.ARRAY_BUFFER, 4 * scene.n, gl.DYNAMIC_DRAW);
  attach(gl, paint.attribute("value"), 1, null);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(scene.F), gl.STATIC_DRAW);
  if (image) {
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.SCISSOR_TEST);

  const home = new Float32Array(about.home), spin = new Float32Array(aboutZ(about.spin));
  const views = {};
  for (const name of ["surface", "plane"]) {
    const panel = byId(name);
    views[name] = { name, panel, mark: panel.querySelector(".mark"), plane: name === "plane", X: null };
  }
  const lines = { rim: strokes(gl, pen, scene, scene.rim), cut: strokes(gl, pen, scene, scene.cut), mark: null };
  const state = { coloring: null, squares: 32, marked: null };

  const reset = (view) => Object.assign(view, { turn: view.plane ? spin : home, shift: [0, 0], zoom: view.plane ? 0.92 : 0.95, X: null });
  Object.values(views).forEach(reset);

  function frame(view) { // where the panel lies on the canvas, and what is one unit in it
    const box = view.panel.getBoundingClientRect(), all = canvas.getBoundingClientRect();
    const side = Math.min(box.width, box.height);
    return { x: box.left - all.left, y: all.bottom - box.bottom, width: box.width, height: box.height, box,
      aspect: [side / box.width, side / box.height] };
  }
  const toPanel = (view, p) => { // pixels in the panel of a point in view coordinates
    const { width, height, aspect } = frame(view);
    return [0, 1].map((c) => (0.5 + (c ? -0.5 : 0.5) * (p[c] * view.zoom + view.shift[c]) * aspect[c]) * (c ? height : width));
  };
  const fromPanel = (view, x, y) => {
    const { width, height, aspect } = frame(view);
    return [((2 * x) / width - 1) / aspect[0], (1 - (2 * y) / height) / aspect[1]].map((s, c) => (s - view.shift[c]) / view.zoom);
  };

  // Coordinates of all vertices as a view has them, until it turns.
  function seen(view) {
    if (view.X) return view;
    const { n, P, UV } = scene;
    view.X = new Float32Array(n); view.Y = new Float32Array(n); view.Z = view.plane ? null : new Float32Array(n);
    for (let i = 0; i < n; i++)
      if (view.plane) [view.X[i], view.Y[i]] = times(view.turn, [UV[2 * i], UV[2 * i + 1], 0], 0);
      else [view.X[i], view.Y[i], view.Z[i]] = times(view.turn, P, 3 * i);
    return view;
  }
  const hit = (view, x, y) => { const s = seen(view); return faceAt(scene.F, s.X, s.Y, s.Z, x, y); };

  let pending = false;
  const redraw = () => { if (!pending) { pending = true; requestAnimationFrame(draw); } };
  function draw() {
    pending = false;
    const ratio = Math.min(window.devicePixelRatio || 1, 2), all = canvas.getBoundingClientRect();
    const [width, height] = [Math.round(all.width * ratio), Math.round(all.height * ratio)];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const css = getComputedStyle(document.documentElement);
    const ink = (name) => [1, 3, 5].map((i) => parseInt(css.getPropertyValue(name).trim().slice(i, i + 2), 16) / 255);
    for (const view of Object.values(views)) {
      const f = frame(view), area = [f.x, f.y, f.width, f.height].map((s) => Math.round(s * ratio));
      gl.viewport(...area);
      gl.scissor(...area);
      gl.clearColor(...ink("--panel"), 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      for (const { made, uniforms } of [paint, pen]) {
        gl.useProgram(made);
        gl.uniformMatrix3fv(uniforms.turn, true, view.turn);
        gl.uniform2f(uniforms.shift, ...view.shift);
        gl.uniform2f(uniforms.aspect, ...f.aspect);
        gl.uniform1f(uniforms.zoom, view.zoom);
        gl.uniform1i(uniforms.plane, view.plane);
      }
      gl.useProgram(paint.made);
      gl.uniformMatrix3fv(paint.uniforms.home, true, home);
      gl.uniform1i(paint.uniforms.kind, ["normals", "checkerboard", "values", "image"].indexOf(state.coloring.kind));
      gl.uniform1f(paint.uniforms.squares, state.squares);
      gl.uniform2f(paint.uniforms.origin, ...about.origin);
      gl.uniform3fv(paint.uniforms.ramp, (state.coloring.ramp || Array(9).fill("#000000")).flatMap(
        (c) => [1, 3, 5].map((i) => parseInt(c.slice(i, i + 2), 16) / 255)));
      gl.bindVertexArray(surface);
      gl.drawElements(gl.TRIANGLES, 3 * scene.m, gl.UNSIGNED_INT, 0);
      gl.useProgram(pen.made);
      gl.uniform2f(pen.uniforms.pixel, 2 / area[2], 2 / area[3]);
      for (const [stroke, name, wide] of [[lines.rim, "--rim", 1.5], [lines.cut, "--cut", 2], [lines.mark, "--accent", 2]]) {
        if (!stroke || !stroke.count) continue;
        gl.uniform1f(pen.uniforms.width, wide * ratio);
        gl.uniform4f(pen.uniforms.ink, ...ink(name), 1);
        gl.bindVertexArray(stroke.array);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, stroke.count);
      }
    }
    placeMarks();
  }

  function placeMarks() {
    for (const view of Object.values(views)) {
      view.mark.hidden = !state.marked;
      if (!state.marked) continue;
      const p = place(view, state.marked), front = view.plane ? null : hit(view, p[0], p[1]);
      const [x, y] = toPanel(view, p);
      Object.assign(view.mark.style, { left: `${x}px`, top: `${y}px` });
      view.mark.classList.toggle("behind", front !== null && front.depth > p[2] + 0.01);
    }
  }
  function place(view, { face, weights }) { // in view coordinates
    const p = [0, 0, 0], s = seen(view);
    weights.forEach((w, c) => {
      const i = scene.F[3 * face + c];
      p[0] += w * s.X[i]; p[1] += w * s.Y[i]; p[2] += s.Z ? w * s.Z[i] : 0;
    });
    return p;
  }

  function mark(found) {
    state.marked = found;
    if (lines.mark) lines.mark.free();
    lines.mark = null;
    const readout = byId("readout");
    if (found) {
      const [i, j, k] = scene.F.slice(3 * found.face, 3 * found.face + 3);
      lines.mark = strokes(gl, pen, scene, [i, j, j, k, k, i]);
      const nearest = [i, j, k][found.weights.indexOf(Math.max(...found.weights))];
      const { faceOrder, vertexOrder } = scene.arrays;
      const face = faceOrder[found.face];
      const [u, v] = [0, 1].map((c) => [i, j, k].reduce((sum, at, n) => sum + about.scale * found.weights[n] * scene.UV[2 * at + c], about.middle[c]));
      const values = about.colorings.filter((c) => c.kind === "values").map((c) => {
        const x = c.low + ((c.high - c.low) * scene.arrays[c.array][nearest]) / 255;
        return `${c.name} ${x.toPrecision(3)}${c.unit}`;
      });
      readout.textContent = [`face ${face.toLocaleString("en")}`,
        `vertex ${vertexOrder[nearest].toLocaleString("en")}`,
        `(${u.toFixed(4)}, ${v.toFixed(4)})`, ...values].join("  ·  ");
      readout.dataset.face = face;
    } else {
      readout.textContent = "Hover to mark a face on both sides";
      delete readout.dataset.face;
    }
    redraw();
  }

  function choose(index) {
    const coloring = about.colorings[index];
    if (!coloring) return;
    state.coloring = coloring;
    [...byId("colorings").children].forEach((b, i) => {
      b.setAttribute("aria-checked", i === index);
      b.tabIndex = i === index ? 0 : -1;
    });
    byId("squares-label").hidden = coloring.kind !== "checkerboard";
    const legend = byId("legend");
    legend.hidden = coloring.kind !== "values";
    if (coloring.kind === "values") {
      gl.bindBuffer(gl.ARRAY_BUFFER, values);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, Float32Array.from(scene.arrays[coloring.array], (x) => x / 255));
      legend.replaceChildren(...[["b", coloring.legend], ["span", coloring.ends[0]], ["i", ""], ["span", coloring.ends[1]]].map(
        ([tag, text]) => Object.assign(document.createElement(tag), { textContent: text })));
      legend.querySelector("i").style.background = `linear-gradient(90deg, ${coloring.ramp.join()})`;
    }
    redraw();
  }

  function zoomAt(view, x, y, factor) { // what is at (x, y) stays there
    const before = fromPanel(view, x, y), zoom = Math.min(Math.max(view.zoom * factor, 0.2), 5000);
    view.shift = view.shift.map((s, c) => s + before[c] * (view.zoom - zoom));
    view.zoom = zoom;
    redraw();
  }
  function move(view, dx, dy) {
    const { width, height, aspect } = frame(view);
    view.shift = [view.shift[0] + (2 * dx) / width / aspect[0], view.shift[1] - (2 * dy) / height / aspect[1]];
    redraw();
  }
  function turn(view, dx, dy) {
    view.turn = product(product(aboutX(dy * 0.008), aboutY(dx * 0.008)), view.turn);
    view.X = null;
    redraw();
  }

  for (const view of Object.values(views)) listen(view);
  function listen(view) {
    const { panel } = view, down = new Map();
    const position = (event) => { const { box } = frame(view); return [event.clientX - box.left, event.clientY - box.top]; };
    const look = (event) => mark(hit(view, ...fromPanel(view, ...position(event))));
    panel.addEventListener("pointerdown", (event) => {
      panel.setPointerCapture(event.pointerId);
      down.set(event.pointerId, position(event));
      if (event.pointerType === "touch") look(event);
    });
    panel.addEventListener("pointermove", (event) => {
      const now = position(event), before = down.get(event.pointerId);
      if (!before) { look(event); return; }
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      const other = [...down.entries()].find(([id]) => id !== event.pointerId);
      if (other) {
        const span = (p) => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]);
        zoomAt(view, (now[0] + other[1][0]) / 2, (now[1] + other[1][1]) / 2, span(now) / Math.max(span(before), 1));
        move(view, dx / 2, dy / 2);
      } else if (view.plane || event.shiftKey || event.buttons === 2) move(view, dx, dy);
      else turn(view, dx, dy);
      down.set(event.pointerId, now);
    });
    for (const name of ["pointerup", "pointercancel"]) panel.addEventListener(name, (event) => down.delete(event.pointerId));
    panel.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse" && !down.size) mark(null); });
    panel.addEventListener("contextmenu", (event) => event.preventDefault());
    panel.addEventListener("dblclick", () => { reset(view); redraw(); });
    panel.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoomAt(view, ...position(event), Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    panel.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
      const { width, height } = frame(view);
      if (step) (view.plane || event.shiftKey ? move : turn)(view, ...step);
      else if (event.key === "+" || event.key === "=") zoomAt(view, width / 2, height / 2, 1.2);
      else if (event.key === "-") zoomAt(view, width / 2, height / 2, 1 / 1.2);
      else if (event.key === "0") { reset(view); redraw(); }
      else return;
      event.preventDefault();
    });
  }

  about.colorings.forEach((coloring, index) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: coloring.name });
    button.setAttribute("role", "radio");
    button.addEventListener("click", () => choose(index));
    button.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], count = about.colorings.length;
      if (!step) return;
      choose((index + step + count) % count);
      byId("colorings").children[(index + step + count) % count].focus();
    });
    byId("colorings").append(button);
  });
  document.addEventListener("keydown", (event) => { if (/^[1-9]$/.test(event.key)) choose(Number(event.key) - 1); });
  byId("squares").addEventListener("input", (event) => {
    state.squares = 2 ** event.target.value;
    event.target.nextElementSibling.textContent = state.squares;
    redraw();
  });
  new ResizeObserver(redraw).observe(byId("stage"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  choose(0);
}

async function main() {
  const canvas = byId("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl || !window.DecompressionStream) {
    byId("readout").textContent = "This browser has no WebGL 2: the picture is all there is.";
    document.body.dataset.state = "poster";
    return;
  }
  let image = null;
  if (about.image) {
    image = Object.assign(new Image(), { src: about.image });
    await image.decode();
  }
  const scene = makeScene(await unpack());
  canvas.hidden = false;
  byId("poster").hidden = true;
  start(scene, gl, image);
  document.body.dataset.state = "ready";
}
main();
