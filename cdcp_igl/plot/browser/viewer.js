"use strict";
// The surface beside its images in the plane, of one result at a time. WebGL draws one view after
// the other out of sight, at less resolution and with fewer faces while a view moves on a slow
// machine; each panel has a canvas to show it. What is under the pointer is found by looking at
// every face, which is fast enough for a million.

const about = JSON.parse(document.getElementById("about").textContent);
const byId = (id) => document.getElementById(id);

async function unpack(packedText, lengths) {
  const packed = Uint8Array.from(atob(packedText), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const total = bytes.length / 4, arrays = {};
  let at = 0;
  for (const [name, length] of lengths) {
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

function makeScene(told, arrays) {
  const n = arrays.vertexOrder.length, F = arrays.faces, m = F.length / 3;
  const together = (names, at) => { // columns beside one another
    const columns = names.map((name) => arrays[name]), all = new Float32Array(n * names.length);
    columns.forEach((column, c) => { for (let i = 0; i < n; i++) all[columns.length * i + c] = at(column[i], c); });
    return all;
  };
  const maps = told.maps.map((map, k) => ({ ...map, k, P: together([`u ${k}`, `v ${k}`], (q) => q / 32767.5 - 1),
    home: new Float32Array(aboutZ(map.spin)) }));
  const ball = told.ball && together(["u ball", "v ball", "w ball"], (q) => q / 32767.5 - 1);
  const shapes = told.shapes.map(({ name, extent, home }, k) => {
    const P = together([`x ${k}`, `y ${k}`, `z ${k}`], (q, c) => q / 32767.5 - extent[c]), N = new Float32Array(3 * n);
    for (let f = 0; f < m; f++) {
      const [i, j, k] = [3 * F[3 * f], 3 * F[3 * f + 1], 3 * F[3 * f + 2]];
      const ax = P[j] - P[i], ay = P[j + 1] - P[i + 1], az = P[j + 2] - P[i + 2];
      const bx = P[k] - P[i], by = P[k + 1] - P[i + 1], bz = P[k + 2] - P[i + 2];
      const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
      for (const c of [i, j, k]) { N[c] += x; N[c + 1] += y; N[c + 2] += z; }
    }
    if (ball) { // vertices that are there twice, for textures, have one normal
      const sum = new Float32Array(3 * n), place = (c) => 3 * arrays.vertexOrder[Math.floor(c / 3)] + (c % 3);
      N.forEach((x, c) => { sum[place(c)] += x; });
      N.forEach((_, c) => { N[c] = sum[place(c)]; });
    }
    let radius = 0;
    for (let i = 0; i < 3 * n; i += 3) radius = Math.max(radius, Math.hypot(P[i], P[i + 1], P[i + 2]));
    for (let i = 0; i < 3 * n; i++) P[i] /= radius;
    return { name, P, N, home: new Float32Array(home) };
  });
  return { ...told, n, F, shapes, maps, ball, arrays };
}

// Pairs of vertices; an edge that is passed one way only lies at a border, which is drawn anyway.
function edgesOf(F) {
  const edges = [];
  for (let c = 0; c < F.length; c++) {
    const i = F[c], j = F[c % 3 < 2 ? c + 1 : c - 2];
    if (i < j) edges.push(i, j);
  }
  return Uint32Array.from(edges);
}

const middle = (three) => [...three].sort((a, b) => a - b)[1];

// Faces, each ending with a corner that has the middle one of its labels: that is its colour.
function byLabel(F, labels) {
  const turned = Uint32Array.from(F);
  for (let c = 0; labels && c < F.length; c += 3) {
    const of = [0, 1, 2].map((k) => labels[F[c + k]]);
    const last = of.indexOf(middle(of));
    for (let k = 0; k < 3; k++) turned[c + k] = F[c + ((last + 1 + k) % 3)];
  }
  return turned;
}

// Faces between the first vertices in the cells of a grid. What was cut apart stays apart, as the
// cells are of the surface and of its image.
function fewerFaces({ n, F, shapes: [{ P }], maps: [{ P: UV }] }, cells) {
  const cell = (x, count) => Math.min(Math.floor((count * (x + 1)) / 2), count - 1);
  const first = new Map(), standIn = new Uint32Array(n);
  for (let i = 0; i < n; i++) {
    let name = 16 * cell(UV[2 * i], 16) + cell(UV[2 * i + 1], 16);
    for (let c = 0; c < 3; c++) name = cells * name + cell(P[3 * i + c], cells);
    if (!first.has(name)) first.set(name, i);
    standIn[i] = first.get(name);
  }
  const kept = [];
  for (let c = 0; c < F.length; c += 3) {
    const [i, j, k] = [standIn[F[c]], standIn[F[c + 1]], standIn[F[c + 2]]];
    if (i !== j && j !== k && k !== i) kept.push(i, j, k);
  }
  return kept;
}

const VERTEX = `#version 300 es
in vec3 position, normal, ball; in vec2 uv; in float value;
uniform mat3 turn; uniform vec2 shift, aspect; uniform float zoom;
out vec3 n, place; out vec2 at; out float x; flat out float label;
void main() {
  vec3 p = turn * position;
  gl_Position = vec4((p.xy * zoom + shift) * aspect, -0.9 * p.z, 1);
  n = normal; at = uv; x = value; label = value; place = ball;
}`;

// Labels one after the other are far apart in hue and brightness, by a sequence of low discrepancy.
const labelColor = (k) => [0, 1, 2].map((c) => (0.62 + 0.3 * Math.cos(6.2831853 * (0.754878 * k + c / 3))) * (1 - 0.45 * ((0.56984 * k) % 1)));
const LABEL = "(0.62 + 0.3 * cos(6.2831853 * (0.754878 * label + vec3(0, 1, 2) / 3.0))) * (1.0 - 0.45 * fract(0.56984 * label))";

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 n, place; in vec2 at; in float x; flat in float label;
uniform mat3 turn, home; uniform bool plane, onBall, round, beyond; uniform int kind; uniform float squares;
uniform vec3 ramp[9], scale, paper; uniform sampler2D image; uniform vec2 origin;
out vec4 color;
// Mean of a square wave of period 2 over a width w: the difference of its integral.
float integral(float t) { return abs(mod(t, 2.0) - 1.0); }
float wave(float t, float w) { return (integral(t + w / 2.0) - integral(t - w / 2.0)) / w; }
void main() {
  if (kind < 0) { color = vec4(0, 0, 0, 0.4); return; }
  vec3 unit = normalize(n);
  vec3 base;
  if (kind == 0) base = 0.5 + 0.5 * (home * unit);
  else if (kind == 1) {
    vec2 c = at * squares / 2.0, w = max(fwidth(c), 1e-6);
    if (round) { // Mercator's map; its date line is on another side of the second one
      vec3 p = normalize(home * place);
      float scale = squares / 6.2831853, east = atan(p.x, p.z);
      c = scale * vec2(east, atanh(clamp(p.y, -0.998, 0.998)));
      w = max(min(fwidth(c), vec2(fwidth(scale * atan(-p.x, -p.z)), 1e6)), 1e-6);
    }
    float light = 0.5 + 0.5 * wave(c.x, w.x) * wave(c.y, w.y);
    base = mix(vec3(0.16, 0.30, 0.47), vec3(0.96, 0.94, 0.89), light);
  } else if (kind == 2) { // from scale.x to scale.y; grey below scale.z, and where there is no value
    float t = clamp((x - scale.x) / (scale.y - scale.x), 0.0, 1.0) * 8.0; int i = min(int(t), 7);
    base = abs(x) < scale.z || x < -1e29 ? vec3(0.62) : mix(ramp[i], ramp[i + 1], t - float(i));
  } else if (kind == 3) {
    base = texture(image, vec2(origin.x + 0.5 * at.x, 1.0 - origin.y - 0.5 * at.y)).rgb;
    if (beyond) base = mix(base, paper, 0.6);
  } else base = label < 0.0 ? vec3(0.62) : ${LABEL};
  if (!plane) {
    vec3 seen = turn * (onBall ? normalize(place) : unit);
    float back = gl_FrontFacing ? 1.0 : 0.62;
    vec3 key = normalize(vec3(-0.35, 0.5, 0.79));
    float light = 0.52 + 0.55 * max(dot(gl_FrontFacing ? seen : -seen, key), 0.0);
    base = base * light * back + 0.05 * pow(max(dot(reflect(-key, seen), vec3(0, 0, 1)), 0.0), 24.0);
  }
  color = vec4(base, 1);
}`;

// An edge is a rectangle as wide as a pen, a little in front of the surface.
const PEN = `#version 300 es
in vec3 start, end;
uniform mat3 turn; uniform vec2 shift, aspect, pixel; uniform float zoom, width;
void main() {
  vec3 a = turn * start, b = turn * end;
  vec2 A = (a.xy * zoom + shift) * aspect, B = (b.xy * zoom + shift) * aspect;
  vec2 along = (B - A) / pixel; float length_ = length(along);
  along = length_ > 0.0 ? along / length_ : vec2(1, 0);
  bool last = gl_VertexID > 1; float side = gl_VertexID % 2 == 0 ? -1.0 : 1.0;
  vec2 moved = (vec2(-along.y, along.x) * side + along * (last ? 1.0 : -1.0) * 0.5) * width / 2.0 * pixel;
  gl_Position = vec4((last ? B : A) + moved, -0.9 * (last ? b.z : a.z) - 0.004, 1);
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

const buffer = (gl, data, target = gl.ARRAY_BUFFER) => {
  const made = gl.createBuffer();
  gl.bindBuffer(target, made);
  gl.bufferData(target, data, gl.STATIC_DRAW);
  return made;
};

function attach(gl, location, size, from, divisor = 0, stride = 0, offset = 0) {
  if (location < 0) return;
  gl.bindBuffer(gl.ARRAY_BUFFER, from);
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, size, gl.FLOAT, false, stride, offset);
  gl.vertexAttribDivisor(location, divisor);
}

function strokes(gl, pen, points, size, ends) { // pairs of vertices as instances of a rectangle
  const array = gl.createVertexArray();
  const at = buffer(gl, Float32Array.from({ length: size * ends.length }, (_, c) => points[size * ends[Math.floor(c / size)] + (c % size)]));
  gl.bindVertexArray(array);
  attach(gl, pen.attribute("start"), size, at, 1, 8 * size, 0);
  attach(gl, pen.attribute("end"), size, at, 1, 8 * size, 4 * size);
  return { array, count: ends.length / 2 };
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

// The outline of a histogram of values, above a strip.
function histogram(values, low, high) {
  const counts = new Array(64).fill(0);
  for (const x of values) if (x >= low && x <= high) counts[Math.min(Math.floor((64 * (x - low)) / (high - low)), 63)]++;
  const most = Math.max(...counts, 1);
  const steps = counts.flatMap((count, k) => [k, k + 1].map((x) => `${(100 * x) / 64}% ${75 * (1 - count / most)}%`));
  return `polygon(0% 100%, ${steps.join()}, 100% 100%)`;
}

// A view with the y axis or the z axis up, of the side that was seen before.
function upright(home, axis) {
  if (!axis) return home;
  const up = axis === "y" ? [0, 1, 0] : [0, 0, 1], c = axis === "y" ? 1 : 2;
  let towards = [...home.slice(6)];
  if (Math.abs(towards[c]) > 0.95) towards = [...home.slice(3, 6)].map((x) => -x); // it was seen from above
  towards[c] = 0;
  const length = Math.hypot(...towards);
  const [x, y, z] = towards.map((t) => t / length);
  return new Float32Array([up[1] * z - up[2] * y, up[2] * x - up[0] * z, up[0] * y - up[1] * x, ...up, x, y, z]);
}

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

const SMOOTH = 45; // milliseconds between frames; a slower machine draws less while a view moves
// From much to little: pixels that are drawn to one of the page, a side, and cells of the grid
// that thins out the faces.
const EFFORTS = [[2, null], [1, null], [0.6, 80], [0.5, 40]];
const MOST_LABELS = 200; // in the legend
const MOST_STROKES = 300000; // edges of a wireframe by the pen: without a graphics card more are slow, and are thin lines
const REST = 400; // milliseconds without a movement, after which a view is drawn in full

function start(gl, image) {
  const paint = program(gl, VERTEX, FRAGMENT), pen = program(gl, PEN, INK);
  if (image) {
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST); // texels are squares
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }
  gl.enable(gl.DEPTH_TEST);
  gl.depthFunc(gl.LEQUAL);
  gl.polygonOffset(1, 1);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);

  // The map is the one whose colours the surface has; labels have lines between them.
  const state = { coloring: null, labels: null, squares: 32, wire: false, borders: true, up: null, shape: 0, map: 0,
    marked: null, pinned: false, effort: 0, last: 0 };
  const opened = [];
  let scene = null, views = [];

  async function load(k) {
    const told = about.scenes[k];
    const scene = makeScene(told, await unpack(byId("data").textContent.trim().split("\n")[k], told.arrays));
    // Made when they are needed first: buffers of arrays, values of colourings, faces by cells.
    scene.buffers = new Map(); scene.values = new Map(); scene.drawn = new Map();
    const views = ["Surface", ...told.panels].map((name, k) => makeView(scene, name, k));
    return { scene, views };
  }

  function makeView(scene, name, k) {
    const onBall = k === 1 && Boolean(scene.ball), plane = k > 0 && !onBall, card = byId("card").content.firstElementChild.cloneNode(true);
    const panel = card.querySelector(".panel"), steps = scene.maps.filter((map) => map.panel === k - 1);
    panel.id = ["surface", "plane"][k] || `plane${k}`;
    panel.ariaLabel = `${name}. Arrow keys ${plane ? "move" : "turn"} it, plus and minus zoom, 0 resets.`;
    const view = { card, panel, name, plane, onBall, size: plane ? 2 : 3, step: 0, steps, strokes: new Map(),
      array: gl.createVertexArray(), square: gl.createVertexArray(), canvas: panel.querySelector("canvas"),
      ring: panel.querySelector(".mark"), outline: panel.querySelector("polygon") };
    caption(scene, view);
    listen(view);
    return view;
  }

  // What stands above a panel: the name, which may be a switch, and what there is to know.
  function caption(scene, view) {
    const title = view.card.querySelector("b"), slider = view.card.querySelector("input");
    title.textContent = view.name;
    if (view.steps.length === 0 && scene.shapes.length > 1) {
      const select = document.createElement("select");
      select.ariaLabel = "Shape";
      select.append(...scene.shapes.map(({ name }, k) => new Option(name, k)));
      select.addEventListener("change", () => reshape(Number(select.value)));
      title.replaceChildren(select);
    } else if (view.steps.length && scene.panels.length > 1) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: view.name, title: "colours the surface by this map" });
      button.addEventListener("click", () => activate(view));
      title.replaceChildren(button);
    }
    slider.hidden = view.steps.length < 2;
    slider.max = view.steps.length - 1;
    slider.ariaLabel = "What the map keeps";
    slider.addEventListener("input", () => {
      view.step = Number(slider.value);
      activate(view);
    });
  }
  function activate(view) {
    state.map = view.steps[view.step].k;
    forget(view);
    recolor();
  }
  const mapOf = (view) => view.steps[view.step] || scene.maps[state.map];
  const shape = () => scene.shapes[state.shape] || scene.shapes[0];
  const homeOf = (view) => view.plane ? mapOf(view).home : upright(view.onBall ? scene.shapes[0].home : shape().home, state.up);
  const placesOf = (view) => view.onBall ? scene.ball : view.plane ? mapOf(view).P : shape().P;
  const forget = (view) => { view.X = null; };

  function reshape(k) {
    const [view] = views, before = homeOf(view).join();
    state.shape = k;
    forget(view);
    if (homeOf(view).join() !== before) reset(view); // a flat one is seen from above
    recolor();
  }

  // Values of a colouring at the vertices: of labels their numbers, of measures those of a map.
  function valuesOf(coloring, map) {
    const name = coloring.each ? `${coloring.array} ${map.k}` : coloring.array;
    if (!scene.values.has(name)) {
      const { from, to, steps } = coloring, size = steps ? (to - from) / steps : 0, missing = coloring.labels ? -1 : -1e38;
      scene.values.set(name, Float32Array.from(scene.arrays[name], (q) => q < 0 ? missing : from + size * q));
    }
    return scene.values.get(name);
  }
  function stored(array, target = gl.ARRAY_BUFFER) {
    if (!scene.buffers.has(array)) scene.buffers.set(array, buffer(gl, array, target));
    return scene.buffers.get(array);
  }

  // Give a view the arrays of what it shows.
  function dress(view) {
    const { coloring } = state, valued = coloring.array;
    gl.bindVertexArray(view.array);
    attach(gl, paint.attribute("position"), view.size, stored(placesOf(view)));
    attach(gl, paint.attribute("normal"), 3, stored(shape().N));
    attach(gl, paint.attribute("uv"), 2, stored(mapOf(view).P));
    if (scene.ball) attach(gl, paint.attribute("ball"), 3, stored(scene.ball));
    if (valued) attach(gl, paint.attribute("value"), 1, stored(valuesOf(coloring, mapOf(view))));
    else gl.disableVertexAttribArray(paint.attribute("value"));
  }
  function recolor() {
    for (const view of views) {
      dress(view);
      const map = view.steps[view.step], span = view.card.querySelector("span"), button = view.card.querySelector("button");
      if (button) button.setAttribute("aria-pressed", map.k === state.map);
      const borrowed = scene.panels.length > 1 && (state.coloring.each || state.coloring.kind === "checkerboard");
      span.textContent = map ? [map.step, map.facts].filter(Boolean).join(" · ")
        : borrowed ? `colours of ${scene.panels[scene.maps[state.map].panel]}` : "";
      span.classList.toggle("bad", span.textContent.includes("NOT VALID"));
    }
    describe();
    redraw();
  }

  async function open(k) {
    const first = !scene;
    opened[k] ??= await load(k);
    for (const view of views) { clearTimeout(view.rest); view.card.remove(); }
    stale.clear();
    ({ scene, views } = opened[k]);
    byId("facts").textContent = scene.facts;
    state.shape = Math.min(state.shape, scene.shapes.length - 1);
    state.map = Math.min(state.map, scene.maps.length - 1);
    const select = views[0].card.querySelector("select");
    if (select) select.value = state.shape;
    byId("stage").append(...views.map((view) => view.card));
    byId("stage").classList.toggle("several", scene.maps.length > 1);
    byId("stage").classList.toggle("many", views.length > 4);
    for (const view of views) if (!view.turn) reset(view);
    press("scenes", k);
    state.pinned = false;
    choose(first ? 0 : about.colorings.indexOf(state.coloring));
    mark(null);
  }

  function reset(view) { // where it was at first, at rest
    clearTimeout(view.rest);
    Object.assign(view, { turn: homeOf(view), shift: [0, 0], zoom: view.plane ? 0.92 : 0.95, X: null, rest: null });
  }

  function frame(view) { // the panel, and what is one unit in it
    const box = view.panel.getBoundingClientRect(), { width, height } = box;
    const side = Math.min(width, height);
    return { box, width, height, aspect: [side / width, side / height] };
  }
  const toPanel = (view, p) => { // pixels in the panel of a point in view coordinates
    const { width, height, aspect } = frame(view);
    return [0, 1].map((c) => (0.5 + (c ? -0.5 : 0.5) * (p[c] * view.zoom + view.shift[c]) * aspect[c]) * (c ? height : width));
  };
  const fromPanel = (view, x, y) => {
    const { width, height, aspect } = frame(view);
    return [((2 * x) / width - 1) / aspect[0], (1 - (2 * y) / height) / aspect[1]].map((s, c) => (s - view.shift[c]) / view.zoom);
  };
  const vertex = (view, i) => { // in view coordinates
    const { turn, size } = view, at = placesOf(view), [x, y] = [at[size * i], at[size * i + 1]], z = view.plane ? 0 : at[3 * i + 2];
    return [0, 3, 6].map((r) => turn[r] * x + turn[r + 1] * y + turn[r + 2] * z);
  };

  // Coordinates of all vertices as a view has them, until it turns.
  function seen(view) {
    if (view.X) return view;
    const { n } = scene;
    view.X = new Float32Array(n); view.Y = new Float32Array(n); view.Z = view.plane ? null : new Float32Array(n);
    for (let i = 0; i < n; i++) {
      const p = vertex(view, i);
      view.X[i] = p[0]; view.Y[i] = p[1];
      if (view.Z) view.Z[i] = p[2];
    }
    return view;
  }
  const hit = (view, x, y) => { const s = seen(view); return faceAt(scene.F, s.X, s.Y, s.Z, x, y); };

  const sharpness = () => Math.min(window.devicePixelRatio, 2);
  const stale = new Set();
  function redraw(...some) {
    if (!stale.size) requestAnimationFrame(drawAll);
    for (const view of some.length ? some : views) stale.add(view);
  }
  function moved(view) {
    clearTimeout(view.rest);
    view.rest = setTimeout(() => { view.rest = null; state.last = 0; redraw(view); }, REST);
    redraw(view);
  }
  function drawAll(now) {
    const moving = [...stale].some((view) => view.rest), late = (now - state.last) / SMOOTH;
    if (moving && state.last && late > 1) state.effort = Math.min(state.effort + Math.ceil(Math.log2(late)), EFFORTS.length - 1);
    state.last = moving ? now : 0;
    for (const view of stale) draw(view);
    stale.clear();
    placeMarks();
  }

  function draw(view) {
    const f = frame(view), [ratio, cells] = EFFORTS[view.rest ? state.effort : 0];
    const pixels = (ratio) => ({ width: Math.max(Math.round(f.width * ratio), 1), height: Math.max(Math.round(f.height * ratio), 1) });
    const { width, height } = pixels(ratio), shown = pixels(sharpness());
    if (gl.canvas.width !== width || gl.canvas.height !== height) Object.assign(gl.canvas, { width, height });
    const { coloring } = state, part = [cells, coloring.labels && coloring.array].join();
    if (!scene.drawn.has(part)) {
      scene.drawn.set(part, byLabel(cells ? fewerFaces(scene, cells) : scene.F, coloring.labels && scene.arrays[coloring.array]));
    }
    const faces = scene.drawn.get(part), map = mapOf(view);
    const css = getComputedStyle(document.documentElement);
    const ink = (name) => [1, 3, 5].map((i) => parseInt(css.getPropertyValue(name).trim().slice(i, i + 2), 16) / 255);
    gl.viewport(0, 0, width, height);
    gl.clearColor(...ink("--panel"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const { made, uniforms } of [paint, pen]) {
      gl.useProgram(made);
      gl.uniformMatrix3fv(uniforms.turn, true, view.turn);
      gl.uniform2f(uniforms.shift, ...view.shift);
      gl.uniform2f(uniforms.aspect, ...f.aspect);
      gl.uniform1f(uniforms.zoom, view.zoom);
    }
    gl.useProgram(paint.made);
    gl.uniformMatrix3fv(paint.uniforms.home, true, scene.shapes[0].home);
    gl.uniform1i(paint.uniforms.plane, view.plane);
    gl.uniform1i(paint.uniforms.onBall, view.onBall);
    gl.uniform1i(paint.uniforms.round, Boolean(scene.ball) && map.k === 0);
    gl.uniform1i(paint.uniforms.kind, ["normals", "checkerboard", "values", "image", "labels"].indexOf(coloring.kind));
    gl.uniform1f(paint.uniforms.squares, state.squares);
    gl.uniform2f(paint.uniforms.origin, ...scene.origin);
    gl.uniform3f(paint.uniforms.paper, ...ink("--panel"));
    if (coloring.kind === "values") {
      gl.uniform3f(paint.uniforms.scale, coloring.low, coloring.high, coloring.threshold || 0);
      gl.uniform3fv(paint.uniforms.ramp, about.ramps[coloring.ramp].flatMap((c) => [1, 3, 5].map((i) => parseInt(c.slice(i, i + 2), 16) / 255)));
    }
    gl.enable(gl.POLYGON_OFFSET_FILL);
    if (coloring.kind === "image" && view.plane && map.k === 0) square(view);
    gl.bindVertexArray(view.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, stored(faces, gl.ELEMENT_ARRAY_BUFFER));
    gl.drawElements(gl.TRIANGLES, faces.length, gl.UNSIGNED_INT, 0);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.enable(gl.BLEND);
    if (state.wire) scene.arrays.edges ??= edgesOf(scene.F);
    const strokable = state.wire && scene.arrays.edges.length < 2 * MOST_STROKES;
    if (state.wire && !strokable && !cells) {
      gl.uniform1i(paint.uniforms.kind, -1);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, stored(scene.arrays.edges, gl.ELEMENT_ARRAY_BUFFER));
      gl.drawElements(gl.LINES, scene.arrays.edges.length, gl.UNSIGNED_INT, 0);
    }
    gl.useProgram(pen.made);
    gl.uniform2f(pen.uniforms.pixel, 2 / width, 2 / height);
    const labels = state.borders && state.labels && `edges of ${state.labels.array}`;
    const lines = [["edges", "--wire", 1, 0.4, strokable], [labels, "--rim", 1.5, 1, labels], ["rim", "--rim", 1.5, 1, true], ["cut", "--cut", 2, 1, true]];
    for (const [name, color, wide, opaque, drawn] of lines) {
      if (cells || !drawn || !scene.arrays[name].length) continue;
      const at = placesOf(view), of = `${name} of ${view.plane ? map.k : state.shape}`;
      if (!view.strokes.has(of)) view.strokes.set(of, strokes(gl, pen, at, view.size, scene.arrays[name]));
      const { array, count } = view.strokes.get(of);
      gl.uniform1f(pen.uniforms.width, wide * ratio);
      gl.uniform4f(pen.uniforms.ink, ...ink(color), opaque);
      gl.bindVertexArray(array);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    }
    gl.disable(gl.BLEND);
    if (view.canvas.width !== shown.width || view.canvas.height !== shown.height) Object.assign(view.canvas, shown);
    view.canvas.getContext("2d").drawImage(gl.canvas, 0, 0, shown.width, shown.height);
  }

  function square(view) { // the whole image, paler where it is on no face
    const corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map((at) => at.map((x, c) => 2 * (x - scene.origin[c])));
    gl.bindVertexArray(view.square);
    view.corners ??= buffer(gl, new Float32Array(corners.flat()));
    for (const name of ["position", "uv"]) attach(gl, paint.attribute(name), 2, view.corners);
    gl.uniform1i(paint.uniforms.beyond, true);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.uniform1i(paint.uniforms.beyond, false);
  }

  function placeMarks() {
    for (const view of views) {
      view.ring.hidden = !state.marked;
      view.ring.classList.toggle("pinned", state.pinned);
      view.outline.setAttribute("points", "");
      if (!state.marked) continue;
      const { face, weights } = state.marked;
      const corners = [0, 1, 2].map((c) => vertex(view, scene.F[3 * face + c]));
      const p = [0, 1, 2].map((r) => weights.reduce((sum, w, c) => sum + w * corners[c][r], 0));
      const [x, y] = toPanel(view, p);
      Object.assign(view.ring.style, { left: `${x}px`, top: `${y}px` });
      view.outline.setAttribute("points", corners.map((corner) => toPanel(view, corner).join()).join(" "));
      if (view.plane || view.rest) continue;
      const front = hit(view, p[0], p[1]), behind = front !== null && front.depth > p[2] + 0.01;
      for (const element of [view.ring, view.outline]) element.classList.toggle("behind", behind);
    }
  }

  function mark(found) {
    state.marked = found;
    describe();
    placeMarks();
  }
  function describe() { // what is marked
    const readout = byId("readout"), found = state.marked;
    if (!found) {
      readout.textContent = "Point at a face to mark it everywhere";
      delete readout.dataset.face;
      return;
    }
    const corners = [...scene.F.slice(3 * found.face, 3 * found.face + 3)];
    const nearest = corners[found.weights.indexOf(Math.max(...found.weights))];
    const { faceOrder, vertexOrder } = scene.arrays, map = scene.maps[state.map];
    const face = faceOrder[found.face];
    const [u, v] = [0, 1].map((c) => corners.reduce((sum, at, n) => sum + map.scale * found.weights[n] * map.P[2 * at + c], map.middle[c]));
    const values = about.colorings.filter((c) => c.array).map((c) => {
      const x = c.labels ? middle(corners.map((i) => scene.arrays[c.array][i])) : valuesOf(c, map)[nearest];
      const missing = x < (c.labels ? 0 : -1e29);
      return `${c.name} ${missing ? "–" : c.labels ? c.labels[x] : (c.each && x >= c.to ? "≥ " : "") + x.toPrecision(3) + c.unit}`;
    });
    readout.textContent = [...(state.pinned ? ["kept"] : []), `face ${face.toLocaleString("en")}`,
      `vertex ${vertexOrder[nearest].toLocaleString("en")}`,
      `(${u.toFixed(4)}, ${v.toFixed(4)})`, ...values].join("  ·  ");
    readout.dataset.face = face;
  }

  function press(group, index) {
    [...byId(group).children].forEach((button, i) => {
      button.setAttribute("aria-checked", i === index);
      button.tabIndex = i === index ? 0 : -1;
    });
  }
  function choose(index) {
    const coloring = about.colorings[index];
    if (!coloring) return;
    state.coloring = coloring;
    if (coloring.kind === "labels" && scene.arrays[`edges of ${coloring.array}`]) state.labels = coloring;
    press("colorings", index);
    byId("squares-label").hidden = coloring.kind !== "checkerboard";
    recolor();
    explain();
  }

  function explain() { // the colours
    const { coloring } = state, legend = byId("legend"), valued = coloring.kind === "values", list = legend.querySelector("ul");
    legend.hidden = !coloring.array;
    byId("scale").hidden = !valued;
    list.hidden = valued;
    if (legend.hidden) return;
    legend.querySelector("b").textContent = valued ? coloring.legend : "";
    if (!valued) {
      list.replaceChildren(...coloring.labels.slice(0, MOST_LABELS).map((name, k) => {
        const item = Object.assign(document.createElement("li"), { textContent: name });
        item.style.setProperty("--label", `rgb(${labelColor(k).map((x) => 255 * x).join()})`);
        return item;
      }));
      return;
    }
    const scale = legend.querySelector("i");
    for (const end of ["low", "high"]) byId(end).value = Number(coloring[end].toPrecision(3));
    byId("threshold").value = coloring.threshold || 0;
    byId("ramp").value = coloring.ramp;
    scale.style.background = `linear-gradient(90deg, ${about.ramps[coloring.ramp].join()})`;
    scale.style.clipPath = histogram(valuesOf(coloring, scene.maps[state.map]), coloring.low, coloring.high);
  }
  function rescale(change) { // keep what makes no range
    const next = { ...state.coloring, ...change };
    if (Number.isFinite(next.low) && next.high > next.low && next.threshold !== null) Object.assign(state.coloring, change);
    explain();
    redraw();
  }
  const RANGES = { // that go with some colours
    diverging: ({ low, high }) => { const most = Math.max(Math.abs(low), Math.abs(high)); return { low: -most, high: most }; },
    cyclic: ({ from, to }) => ({ low: from, high: to }),
  };
  byId("ramp").append(...Object.keys(about.ramps).map((name) => new Option(name)));
  byId("ramp").addEventListener("change", ({ target: { value } }) => rescale({ ramp: value, ...RANGES[value]?.(state.coloring) }));
  for (const end of ["low", "high", "threshold"]) {
    byId(end).addEventListener("change", (event) => rescale({ [end]: event.target.value === "" ? NaN : Number(event.target.value) }));
  }

  function zoomAt(view, x, y, factor) { // what is at (x, y) stays there
    const before = fromPanel(view, x, y), zoom = Math.min(Math.max(view.zoom * factor, 0.2), 5000);
    view.shift = view.shift.map((s, c) => s + before[c] * (view.zoom - zoom));
    view.zoom = zoom;
    moved(view);
  }
  function move(view, dx, dy) {
    const { width, height, aspect } = frame(view);
    view.shift = [view.shift[0] + (2 * dx) / width / aspect[0], view.shift[1] - (2 * dy) / height / aspect[1]];
    moved(view);
  }
  function turn(view, dx, dy) {
    view.turn = product(product(aboutX(dy * 0.008), aboutY(dx * 0.008)), view.turn);
    view.X = null;
    moved(view);
  }

  function save() { // what the panels show, as a picture
    const stage = byId("stage").getBoundingClientRect(), ratio = sharpness();
    const all = Object.assign(document.createElement("canvas"), { width: Math.floor(stage.width * ratio), height: Math.floor(stage.height * ratio) });
    const paper = all.getContext("2d");
    paper.fillStyle = getComputedStyle(document.body).backgroundColor;
    paper.fillRect(0, 0, all.width, all.height);
    for (const view of views) {
      const { box } = frame(view);
      paper.drawImage(view.canvas, (box.left - stage.left) * ratio, (box.top - stage.top) * ratio);
      paper.font = `${13 * ratio}px sans-serif`;
      paper.fillStyle = getComputedStyle(document.body).color;
      const said = view.card.querySelector("span").textContent, name = view.steps.length ? view.name : shape().name;
      paper.fillText([name, said].filter(Boolean).join(" · "), (box.left - stage.left) * ratio, (box.top - stage.top - 7) * ratio, box.width * ratio);
    }
    Object.assign(document.createElement("a"), { href: all.toDataURL(), download: `${document.title}.png` }).click();
  }

  function listen(view) {
    const { panel } = view, down = new Map();
    const position = (event) => { const { box } = frame(view); return [event.clientX - box.left, event.clientY - box.top]; };
    const look = (event) => mark(hit(view, ...fromPanel(view, ...position(event))));
    let path = 0; // of the pointer since it went down
    panel.addEventListener("pointerdown", (event) => {
      panel.setPointerCapture(event.pointerId);
      down.set(event.pointerId, position(event));
      path = 0;
      if (event.pointerType === "touch") look(event);
    });
    panel.addEventListener("pointermove", (event) => {
      const now = position(event), before = down.get(event.pointerId);
      if (!before) { if (!state.pinned) look(event); return; }
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      path += Math.hypot(dx, dy);
      const other = [...down.entries()].find(([id]) => id !== event.pointerId);
      if (other) {
        const span = (p) => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]);
        zoomAt(view, (now[0] + other[1][0]) / 2, (now[1] + other[1][1]) / 2, span(now) / Math.max(span(before), 1));
        move(view, dx / 2, dy / 2);
      } else if (view.plane || event.shiftKey || event.buttons === 2) move(view, dx, dy);
      else turn(view, dx, dy);
      down.set(event.pointerId, now);
    });
    panel.addEventListener("pointerup", (event) => { // a click keeps what is marked, or lets go
      if (event.pointerType !== "mouse" || event.button || path > 3) return;
      state.pinned = true;
      look(event);
      if (!state.marked) letGo();
    });
    for (const name of ["pointerup", "pointercancel"]) panel.addEventListener(name, (event) => down.delete(event.pointerId));
    panel.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse" && !down.size && !state.pinned) mark(null); });
    panel.addEventListener("contextmenu", (event) => event.preventDefault());
    panel.addEventListener("dblclick", () => { reset(view); redraw(view); });
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
      else if (event.key === "0") { reset(view); redraw(view); }
      else return;
      event.preventDefault();
    });
  }

  function letGo() {
    state.pinned = false;
    mark(null);
  }

  function radios(group, names, chosen) {
    byId(group).append(...names.map((name, index) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
      button.setAttribute("role", "radio");
      button.addEventListener("click", () => chosen(index));
      button.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], next = (index + step + names.length) % names.length;
        if (!step) return;
        chosen(next);
        byId(group).children[next].focus();
      });
      return button;
    }));
    byId(group).hidden = names.length < 2;
  }
  radios("scenes", about.scenes.map(({ name }) => name), open);
  radios("colorings", about.colorings.map(({ name }) => name), choose);
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input, select")) return;
    const count = about.colorings.length, step = { "[": -1, "]": 1 }[event.key];
    if (/^[1-9]$/.test(event.key)) choose(Number(event.key) - 1);
    else if (step) choose((about.colorings.indexOf(state.coloring) + step + count) % count);
    else if (event.key === "Escape") letGo();
  });
  state.labels = about.colorings.find(({ kind, array }) => kind === "labels" && array !== "charts") || null;
  byId("borders").hidden = !state.labels;
  byId("borders").addEventListener("click", (event) => {
    state.borders = !state.borders;
    event.target.setAttribute("aria-pressed", state.borders);
    redraw();
  });
  for (const button of document.querySelectorAll(".up")) {
    button.addEventListener("click", () => {
      state.up = state.up === button.value ? null : button.value;
      for (const other of document.querySelectorAll(".up")) other.setAttribute("aria-pressed", other.value === state.up);
      for (const view of views) if (!view.plane) reset(view);
      redraw();
    });
  }
  byId("wireframe").addEventListener("click", (event) => {
    state.wire = !state.wire;
    event.target.setAttribute("aria-pressed", state.wire);
    redraw();
  });
  byId("reset").addEventListener("click", () => { views.forEach(reset); redraw(); });
  byId("picture").addEventListener("click", save);
  byId("squares").addEventListener("input", (event) => {
    state.squares = 2 ** event.target.value;
    event.target.nextElementSibling.textContent = state.squares;
    redraw();
  });
  new ResizeObserver(() => redraw()).observe(byId("stage"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw());
  return open(0);
}

async function main() {
  const gl = document.createElement("canvas").getContext("webgl2", { alpha: false, antialias: false });
  if (!gl || !window.DecompressionStream) {
    byId("readout").textContent = "This browser has no WebGL 2 here: the picture is all there is.";
    document.body.dataset.state = "poster";
    return;
  }
  let image = null;
  if (about.image) {
    image = Object.assign(new Image(), { src: about.image });
    await image.decode();
  }
  await start(gl, image);
  byId("poster").hidden = true;
  document.body.dataset.state = "ready";
}
main();
