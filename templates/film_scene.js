// The three-dimensional scene of one reel, drawn with WebGL 2. Lengths in m, in the plate's coordinates: x along its
// length, z upwards off its face; the camera stands upright where the plate is tilted.
"use strict";

// A sub-sphere is one point, drawn as a square of its size on which the fragment shader shades a sphere with its true
// depth: one corner instead of hundreds.
film.SPHERE_VERTEX = `#version 300 es
  precision highp float;
  uniform mat4 view, projection;
  uniform float between, quantum, pixels;
  in vec3 before, after, tint;
  in float radius;
  out vec3 colour;
  out float depthOfCentre, size;
  void main() {
    vec4 centre = view * vec4(mix(before, after, between) * quantum, 1.0);
    colour = tint;
    depthOfCentre = centre.z;
    size = radius;
    bool outside = before.x < -32767.5 || after.x < -32767.5;
    gl_Position = outside ? vec4(2.0, 2.0, 2.0, 1.0) : projection * centre;
    gl_PointSize = pixels * projection[1][1] * radius / -centre.z;
  }`;
film.SPHERE_FRAGMENT = `#version 300 es
  precision highp float;
  uniform mat4 projection;
  in vec3 colour;
  in float depthOfCentre, size;
  out vec4 fragment;
  void main() {
    vec2 corner = vec2(2.0, -2.0) * gl_PointCoord + vec2(-1.0, 1.0);
    float far = dot(corner, corner);
    if (far > 1.0) discard;
    vec3 normal = vec3(corner, sqrt(1.0 - far));
    float light = 0.42 + 0.62 * max(0.0, dot(normal, vec3(-0.37, 0.56, 0.74)));
    fragment = vec4(colour * light, 1.0);
    float z = depthOfCentre + normal.z * size;
    gl_FragDepth = 0.5 + 0.5 * (projection[2][2] * z + projection[3][2]) / -z;
  }`;
// Plate, rods, walls and breaking bonds have their colours as they are.
film.PLAIN_VERTEX = `#version 300 es
  precision highp float;
  uniform mat4 view, projection;
  in vec3 position, tint;
  out vec3 colour;
  void main() {
    colour = tint;
    gl_Position = projection * view * vec4(position, 1.0);
    gl_PointSize = 4.0;
  }`;
film.PLAIN_FRAGMENT = `#version 300 es
  precision highp float;
  uniform float opacity;
  in vec3 colour;
  out vec4 fragment;
  void main() { fragment = vec4(colour, opacity); }`;

film.VIEW = { azimuth: -0.98, height: 0.42, zoom: 1 };
film.OPENING = Math.PI / 6; // of the camera, up and down

film.Scene = class {
  constructor(canvas) {
    const gl = this.gl = canvas.getContext("webgl2", { antialias: false, powerPreference: "low-power" });
    if (!gl) throw new Error("the browser has none");
    this.spheres = this.program(film.SPHERE_VERTEX, film.SPHERE_FRAGMENT);
    this.plain = this.program(film.PLAIN_VERTEX, film.PLAIN_FRAGMENT);
    this.view = { ...film.VIEW };
    this.sharpest = this.sharpness = Math.min(window.devicePixelRatio || 1, 1.5); // pixels of the screen a pixel of the page
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  resize(width, height) {
    const canvas = this.gl.canvas;
    [canvas.width, canvas.height] = [Math.round(width * this.sharpness), Math.round(height * this.sharpness)];
    this.aspect = width / height;
  }

  // Columns of numbers that a program draws: {name: [values, numbers a corner, is it a share of 255]}.
  shape(program, columns, triangles) {
    const gl = this.gl, shape = { program, array: gl.createVertexArray(), columns: {}, triangles: triangles?.length };
    gl.bindVertexArray(shape.array);
    for (const [name, [values, size, share]] of Object.entries(columns)) {
      const place = gl.getAttribLocation(program, name), buffer = gl.createBuffer();
      const kind = { Int16Array: gl.SHORT, Uint8Array: gl.UNSIGNED_BYTE, Float32Array: gl.FLOAT }[values.constructor.name];
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, kind, !!share, 0, 0);
      shape.columns[name] = { buffer, array: values };
      shape.count = values.length / size;
    }
    if (triangles) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(triangles), gl.STATIC_DRAW);
    }
    gl.bindVertexArray(null);
    return shape;
  }

  send(shape, ...names) {
    for (const name of names) {
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, shape.columns[name].buffer);
      this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, shape.columns[name].array);
    }
  }

  load(reel) {
    const n = reel.radius.length, gl = this.gl;
    for (const old of Object.values(this.parts || {})) { // what one reel had on the graphics card
      gl.deleteVertexArray(old.array);
      for (const { buffer } of Object.values(old.columns)) gl.deleteBuffer(buffer);
    }
    this.reel = reel;
    this.shown = null;
    const breaks = 3 * Math.max(1, reel.brokenAt.reduce((count, t) => count + (t < Infinity), 0));
    this.parts = {
      stones: this.shape(this.spheres, {
        before: [new Int16Array(3 * n), 3], after: [new Int16Array(3 * n), 3], tint: [new Uint8Array(3 * n), 3, true],
        radius: [reel.radius, 1] }),
      plate: this.makePlate(),
      rods: this.mesh(reel.plate.rods.map((rod) => film.rod(rod, reel.plate.thickness || 0.01))),
      breaks: this.shape(this.plain, { position: [new Float32Array(breaks), 3], tint: [new Uint8Array(breaks), 3, true] }),
      walls: this.mesh(reel.plate.walls.map(film.box)),
    };
  }

  get tint() { return this.parts.stones.columns.tint.array; }

  // Bodies of {points, tint, triangles} as one shape.
  mesh(bodies) {
    const points = [], tint = [], triangles = [];
    for (const body of bodies) {
      triangles.push(...body.triangles.map((k) => k + points.length / 3));
      points.push(...body.points);
      tint.push(...body.tint);
    }
    return this.shape(this.plain, { position: [new Float32Array(points), 3], tint: [new Uint8Array(tint), 3, true] },
      triangles);
  }

  // The plate's upper surface, and its edge down to its thickness.
  makePlate() {
    const plate = this.reel.plate;
    let node = plate.node, quad = plate.quad;
    if (!quad.length) {
      const [x, y] = film.halfSides(plate);
      node = [-x, -y, x, -y, x, y, -x, y];
      quad = [0, 1, 2, 3];
    }
    const n = this.nodes = node.length / 2, uses = new Map(), triangles = [], points = new Float32Array(6 * n);
    for (let q = 0; q < quad.length; q += 4) {
      const c = quad.slice(q, q + 4);
      triangles.push(c[0], c[1], c[2], c[0], c[2], c[3]);
      for (let k = 0; k < 4; k++) {
        const a = c[k], b = c[(k + 1) % 4], key = Math.min(a, b) * 1e6 + Math.max(a, b);
        uses.set(key, uses.has(key) ? null : [a, b]);
      }
    }
    for (const edge of uses.values()) {
      if (!edge) continue;
      const [a, b] = edge;
      triangles.push(a, a + n, b, b, a + n, b + n);
    }
    for (let k = 0; k < n; k++) {
      points.set([node[2 * k], node[2 * k + 1], 0], 3 * k);
      points.set([node[2 * k], node[2 * k + 1], -(plate.thickness || 0.01)], 3 * (k + n));
    }
    return this.shape(this.plain, { position: [points, 3], tint: [new Uint8Array(6 * n).fill(150), 3, true] }, triangles);
  }

  place(series, k, between) {
    const stones = this.parts.stones, next = Math.min(k + 1, series.t.length - 1);
    if (this.shown !== series || this.shownAt !== k) {
      stones.columns.before.array.set(series.position[k]);
      stones.columns.after.array.set(series.position[next]);
      this.send(stones, "before", "after");
      [this.shown, this.shownAt] = [series, k];
    }
    this.between = between;
  }

  placePlate(series, k, between, factor, map, most) {
    if (!this.reel.plate.quad.length) return;
    const next = Math.min(k + 1, series.t.length - 1), n = this.nodes, plate = this.parts.plate;
    const points = plate.columns.position.array, tint = plate.columns.tint.array, thickness = this.reel.plate.thickness || 0.01;
    const w0 = series.deflection[k], w1 = series.deflection[next], s0 = series.stress[k], s1 = series.stress[next];
    const scale = factor * series.deflectionQuantum, shade = 255 * series.stressQuantum / most;
    for (let i = 0; i < n; i++) {
      const w = (w0[i] + between * (w1[i] - w0[i])) * scale;
      points[3 * i + 2] = w;
      points[3 * (i + n) + 2] = w - thickness;
      const c = 3 * Math.max(0, Math.min(255, Math.round((s0[i] + between * (s1[i] - s0[i])) * shade)));
      for (let d = 0; d < 3; d++) {
        tint[3 * i + d] = map[c + d];
        tint[3 * (i + n) + d] = 0.55 * map[c + d];
      }
    }
    this.send(plate, "position", "tint");
  }

  // Bonds that break just now: a dot where each was, seen through the stones.
  placeBreaks(series, k, from, until, colours) {
    const { first, second, brokenAt, shear, quantum } = this.reel, { position, tint } = this.parts.breaks.columns;
    const now = series.position[k];
    let count = 0;
    for (let b = 0; b < first.length; b++) {
      if (brokenAt[b] > until || brokenAt[b] <= from || now[3 * first[b]] === -32768) continue;
      for (let d = 0; d < 3; d++) {
        position.array[3 * count + d] = 0.5 * quantum * (now[3 * first[b] + d] + now[3 * second[b] + d]);
        tint.array[3 * count + d] = colours[shear[b]][d];
      }
      count++;
    }
    this.parts.breaks.count = count;
    this.send(this.parts.breaks, "position", "tint");
  }

  draw() {
    const gl = this.gl, { stones, plate, rods, breaks, walls } = this.parts;
    const camera = film.camera(this.reel.plate, this.view, this.aspect);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.clearColor(...film.ground(), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const use = (shape, kind, uniforms) => {
      if (!shape.count) return;
      gl.useProgram(shape.program);
      gl.bindVertexArray(shape.array);
      for (const name of ["view", "projection"]) {
        gl.uniformMatrix4fv(gl.getUniformLocation(shape.program, name), false, camera[name]);
      }
      for (const [name, value] of Object.entries(uniforms)) gl.uniform1f(gl.getUniformLocation(shape.program, name), value);
      if (shape.triangles) gl.drawElements(kind, shape.triangles, gl.UNSIGNED_INT, 0);
      else gl.drawArrays(kind, 0, shape.count);
    };
    use(plate, gl.TRIANGLES, { opacity: 1 });
    use(rods, gl.TRIANGLES, { opacity: 1 });
    use(stones, gl.POINTS, { between: this.between, quantum: this.reel.quantum, pixels: gl.canvas.height });
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    use(walls, gl.TRIANGLES, { opacity: 0.25 });
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    use(breaks, gl.POINTS, { opacity: 1 });
    gl.enable(gl.DEPTH_TEST);
  }
};

film.ground = () => getComputedStyle(document.documentElement).getPropertyValue("--ground").trim().match(/[0-9a-f]{2}/g)
  .map((part) => parseInt(part, 16) / 255);

film.halfSides = (plate) => (plate.size || [0.5, 0.5]).map((side) => side / 2);

film.rod = function (rod, thickness) {
  const sides = 20, radius = (rod.diameter_m || 0.02) / 2, top = -thickness, points = [], tint = [], triangles = [];
  for (let k = 0; k < sides; k++) {
    const angle = 2 * Math.PI * k / sides, shade = 140 + 45 * Math.cos(angle + 1.2), next = (k + 1) % sides;
    for (const z of [top, top - (rod.length_m || 0.1)]) {
      points.push(rod.place_m[0] + radius * Math.cos(angle), rod.place_m[1] + radius * Math.sin(angle), z);
      tint.push(shade, shade, shade);
    }
    triangles.push(2 * k, 2 * k + 1, 2 * next, 2 * next, 2 * k + 1, 2 * next + 1);
  }
  return { points, tint, triangles };
};

film.box = function ([x0, x1, y0, y1, z0, z1]) {
  const points = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((k) => [k & 1 ? x1 : x0, k & 2 ? y1 : y0, k & 4 ? z1 : z0]);
  const faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
  return { points, tint: points.flatMap(() => [128, 144, 160]).slice(0, 24), triangles: faces.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]) };
};

// What the view has to show whole: the plate on its rods, and as much above it as stones rise. As in report/film/still.py.
film.corners = function (plate) {
  const [x, y] = film.halfSides(plate), thickness = plate.thickness || 0.01;
  const low = -thickness - Math.max(0, ...plate.rods.map((rod) => rod.length_m || 0.1));
  return [low, 0.3 * Math.max(x, y)].flatMap((z) => [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]);
};

// Matrices, column by column, of the camera that looks from an azimuth and a height at the middle of the plate, upright,
// and as near as shows all corners.
film.camera = function (plate, { azimuth, height, zoom }, aspect) {
  const lean = plate.tilt || 0, c = Math.cos(lean), s = Math.sin(lean);
  const turned = ([x, y, z]) => [c * x - s * z, y, s * x + c * z]; // from upright into the plate's coordinates
  const toward = turned([Math.cos(height) * Math.cos(azimuth), Math.cos(height) * Math.sin(azimuth), Math.sin(height)]);
  const right = turned([-Math.sin(azimuth), Math.cos(azimuth), 0]);
  const up = [toward[1] * right[2] - toward[2] * right[1], toward[2] * right[0] - toward[0] * right[2],
    toward[0] * right[1] - toward[1] * right[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2], half = Math.tan(film.OPENING / 2);
  const corners = film.corners(plate), middle = [0, 0, (corners[0][2] + corners[4][2]) / 2];
  const seen = corners.map((p) => p.map((v, d) => v - middle[d])).map((p) => [dot(p, right), dot(p, up), dot(p, toward)]);
  const fitted = Math.max(...seen.map(([r, u, d]) => d + Math.max(Math.abs(u), Math.abs(r) / aspect) / (0.96 * half)));
  const far = fitted * zoom, eye = middle.map((v, d) => v + far * toward[d]), near = 0.02 * far, end = 20 * far;
  return {
    view: [right[0], up[0], toward[0], 0, right[1], up[1], toward[1], 0, right[2], up[2], toward[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(toward, eye), 1],
    projection: [1 / (half * aspect), 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, (near + end) / (near - end), -1,
      0, 0, 2 * near * end / (near - end), 0],
  };
};
