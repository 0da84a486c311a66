// The three-dimensional scene of one reel, drawn with three.js. Lengths in m, z upwards.
"use strict";

// A sub-sphere is one point, drawn as a square of its size on which the fragment shader shades a sphere with its true
// depth: one corner instead of hundreds. (Instances of a small mesh took ten times as long without a graphics card.)
film.SPHERE_VERTEX = `
  precision highp float;
  uniform mat4 modelViewMatrix, projectionMatrix;
  uniform float between, quantum, pixels;
  in vec3 position, after, tint;
  in float radius;
  out vec3 colour;
  out float depthOfCentre, size;
  void main() {
    vec4 centre = modelViewMatrix * vec4(mix(position, after, between) * quantum, 1.0);
    colour = tint;
    depthOfCentre = centre.z;
    size = radius;
    bool outside = position.x < -32767.5 || after.x < -32767.5;
    gl_Position = outside ? vec4(2.0, 2.0, 2.0, 1.0) : projectionMatrix * centre;
    gl_PointSize = pixels * projectionMatrix[1][1] * radius / -centre.z;
  }`;
film.SPHERE_FRAGMENT = `
  precision highp float;
  uniform mat4 projectionMatrix;
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
    gl_FragDepth = 0.5 + 0.5 * (projectionMatrix[2][2] * z + projectionMatrix[3][2]) / -z;
  }`;

film.VIEW = { azimuth: -0.98, height: 0.42, distance: 0.92, target: [0, 0, -0.006] };

film.Scene = class {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: "low-power" });
    this.renderer.setClearColor(0xf4f5f6);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.02, 20);
    this.camera.up.set(0, 0, 1);
    this.view = { ...film.VIEW };
    this.scene.add(new THREE.AmbientLight(0xffffff, 0.55));
    const sun = new THREE.DirectionalLight(0xffffff, 0.6);
    sun.position.set(0.2, -0.6, 0.8);
    this.scene.add(sun);
    this.sharpest = this.sharpness = Math.min(window.devicePixelRatio || 1, 1.5); // pixels of the screen a pixel of the page
  }

  resize(width, height) {
    this.renderer.setPixelRatio(this.sharpness);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.narrow = Math.max(1, 1.45 / this.camera.aspect);
  }

  load(reel) {
    if (this.parts) this.scene.remove(this.parts);
    this.reel = reel;
    this.parts = new THREE.Group();
    this.parts.add(this.makeSpheres(), this.makePlate(), this.makeRods(), this.makeWalls(), this.makeBreaks());
    this.scene.add(this.parts);
  }

  makeSpheres() {
    const n = this.reel.radius.length, geometry = new THREE.BufferGeometry();
    const moving = () => new THREE.BufferAttribute(new Int16Array(3 * n), 3).setUsage(THREE.DynamicDrawUsage);
    this.before = moving();
    this.after = moving();
    this.tint = new THREE.BufferAttribute(new Uint8Array(3 * n), 3, true);
    geometry.setAttribute("position", this.before);
    geometry.setAttribute("after", this.after);
    geometry.setAttribute("tint", this.tint);
    geometry.setAttribute("radius", new THREE.BufferAttribute(this.reel.radius, 1));
    this.uniforms = { between: { value: 0 }, quantum: { value: this.reel.quantum }, pixels: { value: 1 } };
    const material = new THREE.RawShaderMaterial({
      vertexShader: film.SPHERE_VERTEX, fragmentShader: film.SPHERE_FRAGMENT, uniforms: this.uniforms,
      glslVersion: THREE.GLSL3,
    });
    const spheres = new THREE.Points(geometry, material);
    spheres.frustumCulled = false;
    return spheres;
  }

  // The plate's upper surface, and its edge down to its thickness.
  makePlate() {
    const plate = this.reel.plate;
    let node = plate.node, quad = plate.quad;
    if (!quad.length) {
      const x = (plate.length || 0.5) / 2, y = (plate.width || 0.5) / 2;
      node = [-x, -y, x, -y, x, y, -x, y];
      quad = [0, 1, 2, 3];
    }
    this.nodes = node.length / 2;
    const uses = new Map(), triangles = [];
    for (let q = 0; q < quad.length; q += 4) {
      const c = [quad[q], quad[q + 1], quad[q + 2], quad[q + 3]];
      triangles.push(c[0], c[1], c[2], c[0], c[2], c[3]);
      for (let k = 0; k < 4; k++) {
        const a = c[k], b = c[(k + 1) % 4], key = Math.min(a, b) * 1e6 + Math.max(a, b);
        uses.set(key, uses.has(key) ? null : [a, b]);
      }
    }
    for (const edge of uses.values()) {
      if (!edge) continue;
      const [a, b] = edge, n = this.nodes;
      triangles.push(a, a + n, b, b, a + n, b + n);
    }
    const points = new Float32Array(6 * this.nodes);
    for (let k = 0; k < this.nodes; k++) {
      points[3 * k] = points[3 * (k + this.nodes)] = node[2 * k];
      points[3 * k + 1] = points[3 * (k + this.nodes) + 1] = node[2 * k + 1];
      points[3 * (k + this.nodes) + 2] = -(plate.thickness || 0.01);
    }
    const geometry = new THREE.BufferGeometry();
    this.platePoints = new THREE.BufferAttribute(points, 3);
    this.plateTint = new THREE.BufferAttribute(new Uint8Array(6 * this.nodes).fill(150), 3, true);
    geometry.setAttribute("position", this.platePoints);
    geometry.setAttribute("color", this.plateTint);
    geometry.setIndex(triangles);
    const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide }));
    mesh.frustumCulled = false;
    return mesh;
  }

  makeRods() {
    const group = new THREE.Group(), material = new THREE.MeshLambertMaterial({ color: 0x8d949b });
    for (const rod of this.reel.plate.rods) {
      const length = rod.length_m || 0.1, radius = (rod.diameter_m || 0.02) / 2;
      const mesh = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, length, 20), material);
      mesh.rotation.x = Math.PI / 2;
      mesh.position.set(rod.x_m, rod.y_m, -(this.reel.plate.thickness || 0.01) - length / 2);
      group.add(mesh);
    }
    return group;
  }

  makeWalls() {
    const group = new THREE.Group(), material = new THREE.MeshBasicMaterial(
      { color: 0x8090a0, transparent: true, opacity: 0.25, side: THREE.DoubleSide, depthWrite: false });
    for (const [x0, x1, y0, y1, z0, z1] of this.reel.plate.walls) {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(x1 - x0, y1 - y0, z1 - z0), material);
      mesh.position.set((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2);
      group.add(mesh);
    }
    return group;
  }

  // Bonds that break just now: a dot where each was, seen through the stones.
  makeBreaks() {
    const most = Math.max(1, this.reel.brokenAt.reduce((count, t) => count + (t < Infinity), 0));
    this.breakPoints = new THREE.BufferAttribute(new Float32Array(3 * most), 3);
    this.breakTint = new THREE.BufferAttribute(new Uint8Array(3 * most), 3, true);
    this.breakGeometry = new THREE.BufferGeometry();
    this.breakGeometry.setAttribute("position", this.breakPoints);
    this.breakGeometry.setAttribute("color", this.breakTint);
    const points = new THREE.Points(this.breakGeometry, new THREE.PointsMaterial(
      { size: 3, sizeAttenuation: false, vertexColors: true, depthTest: false }));
    points.frustumCulled = false;
    points.renderOrder = 1;
    return points;
  }

  place(series, k, between) {
    const next = Math.min(k + 1, series.t.length - 1);
    if (this.shown !== series || this.shownAt !== k) {
      this.before.array.set(series.position[k]);
      this.after.array.set(series.position[next]);
      this.before.needsUpdate = this.after.needsUpdate = true;
      this.shown = series;
      this.shownAt = k;
    }
    this.uniforms.between.value = between;
  }

  placePlate(series, k, between, factor, map, most) {
    if (!this.reel.plate.quad.length) return;
    const next = Math.min(k + 1, series.t.length - 1), n = this.nodes, points = this.platePoints.array;
    const tint = this.plateTint.array, thickness = this.reel.plate.thickness || 0.01;
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
    this.platePoints.needsUpdate = this.plateTint.needsUpdate = true;
  }

  placeBreaks(series, k, from, until, colours) {
    const { first, second, brokenAt, shear, quantum } = this.reel, points = this.breakPoints.array;
    const now = series.position[k];
    let count = 0;
    for (let b = 0; b < first.length; b++) {
      if (brokenAt[b] > until || brokenAt[b] <= from || now[3 * first[b]] === -32768) continue;
      for (let d = 0; d < 3; d++) {
        points[3 * count + d] = 0.5 * quantum * (now[3 * first[b] + d] + now[3 * second[b] + d]);
        this.breakTint.array[3 * count + d] = colours[shear[b]][d];
      }
      count++;
    }
    this.breakPoints.needsUpdate = this.breakTint.needsUpdate = true;
    this.breakGeometry.setDrawRange(0, count);
  }

  draw() {
    const { azimuth, height, distance, target } = this.view, far = distance * this.narrow;
    this.camera.position.set(
      target[0] + far * Math.cos(height) * Math.cos(azimuth), target[1] + far * Math.cos(height) * Math.sin(azimuth),
      target[2] + far * Math.sin(height));
    this.camera.lookAt(...target);
    this.uniforms.pixels.value = this.renderer.domElement.height;
    this.renderer.render(this.scene, this.camera);
  }
};
