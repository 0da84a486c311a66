// The view at the head of the report: which reel, which instant, which colours; time runs while it plays.
"use strict";

film.PLAY_SECONDS = { impact: 9, early: 12, whole: 15 }; // a stretch of time lasts so long on the screen
film.PIECES = [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];
film.DARK = matchMedia("(prefers-color-scheme: dark)").matches;
film.MATERIALS = [film.DARK ? [150, 155, 162] : [66, 66, 70], [214, 160, 96]]; // coal, gangue; as --coal has it
film.MODES = [[213, 94, 0], [86, 180, 233]]; // tension, shear
film.GREATEST_DEFLECTION_M = 0.01; // to which the plate's motion is enlarged on the screen

film.Player = class {
  constructor(root) {
    this.root = root;
    this.find = (name) => root.querySelector(`[data-film=${name}]`);
    this.canvas = this.find("canvas");
    this.scene = new film.Scene(this.canvas);
    this.maps = JSON.parse(document.getElementById("film-maps").textContent)
      .map((text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
    this.reels = new Map();
    this.time = 0;
    this.playing = false;
    this.dirty = true;
    this.frames = 0;
    this.listen();
  }

  async start() {
    this.resize();
    await this.chooseReel(this.find("reel").value);
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
    this.resize();
    this.seek(this.momentOfLargestForce());
    this.tick(performance.now());
    this.root.classList.add("live");
  }

  async chooseReel(id) {
    this.play(false);
    if (!this.reels.has(id)) this.reels.set(id, await film.readReel(id));
    this.reel = this.reels.get(id);
    this.series = null; // nothing is drawn until one of this reel is there
    this.scene.load(this.reel);
    const select = this.find("series"), wanted = select.value;
    select.replaceChildren(...this.reel.packed.map((p) => new Option(p.title, p.key)));
    if (this.reel.packed.some((p) => p.key === wanted)) select.value = wanted;
    await this.chooseSeries(select.value, true);
  }

  async chooseSeries(key, keepTime) {
    this.series = await film.seriesOf(this.reel, key);
    const largest = 32767 * Math.max(...this.reel.packed.map((p) => p.deflectionQuantum));
    this.enlarged = this.reel.plate.quad.length ? Number((film.GREATEST_DEFLECTION_M / largest).toPrecision(1)) : 1;
    this.find("stress").hidden = this.find("factor").hidden = !this.reel.plate.quad.length;
    this.find("breaks").hidden = !this.reel.first.length;
    this.find("stress-most").textContent = `${page.digits(Number((1e-6 * this.series.stressShown).toPrecision(2)))} MPa and more`;
    const factor = this.find("factor");
    factor.options[0].textContent = `deflection × ${this.enlarged}`;
    film.drawCurves(this.find("curves"), this.series);
    if (!keepTime || this.time > this.series.end) this.time = 0;
    this.tinted = null;
    this.seek(this.time);
  }

  momentOfLargestForce() {
    const { t, value } = this.series.curves.force;
    let k = 0;
    for (let i = 0; i < t.length; i++) if (value[i] > value[k]) k = i;
    return t[k];
  }

  listen() {
    this.find("reel").addEventListener("change", (e) => this.chooseReel(e.target.value));
    this.find("series").addEventListener("change", (e) => this.chooseSeries(e.target.value, false));
    for (const name of ["colours", "factor"]) {
      this.find(name).addEventListener("change", () => { this.tinted = null; this.dirty = true; });
    }
    this.find("slider").addEventListener("input", (e) => {
      this.play(false);
      this.seek(e.target.value * this.series.end / e.target.max);
    });
    this.find("play").addEventListener("click", () => this.play(!this.playing));
    this.find("curves").addEventListener("click", (e) => {
      const box = this.find("curves").getBoundingClientRect();
      this.seek(film.timeAt((e.clientX - box.left) / box.width, this.series));
    });
    this.listenToPointer();
  }

  listenToPointer() {
    const canvas = this.canvas, view = this.scene.view;
    canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
    canvas.addEventListener("pointermove", (e) => {
      if (!canvas.hasPointerCapture(e.pointerId)) return;
      view.azimuth -= 0.008 * e.movementX;
      view.height = Math.max(-0.35, Math.min(1.5, view.height + 0.008 * e.movementY));
      this.dirty = true;
    });
    canvas.addEventListener("wheel", (e) => {
      if (document.activeElement !== canvas && !e.ctrlKey) return; // the page scrolls until the view was clicked
      e.preventDefault();
      this.zoom(Math.exp(0.001 * e.deltaY));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { Object.assign(view, film.VIEW); this.dirty = true; });
    canvas.addEventListener("keydown", (e) => this.key(e));
    this.find("nearer").addEventListener("click", () => this.zoom(0.8));
    this.find("farther").addEventListener("click", () => this.zoom(1.25));
  }

  key(event) {
    const view = this.scene.view;
    const moves = {
      ArrowLeft: () => (view.azimuth -= 0.1), ArrowRight: () => (view.azimuth += 0.1),
      ArrowUp: () => (view.height = Math.min(1.5, view.height + 0.1)),
      ArrowDown: () => (view.height = Math.max(-0.35, view.height - 0.1)),
      "+": () => this.zoom(0.8), "-": () => this.zoom(1.25), " ": () => this.play(!this.playing),
    };
    if (!moves[event.key]) return;
    event.preventDefault();
    moves[event.key]();
    this.dirty = true;
  }

  zoom(factor) {
    this.scene.view.zoom = Math.max(0.15, Math.min(4, this.scene.view.zoom * factor));
    this.dirty = true;
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    if (!clientWidth || !clientHeight) return;
    this.scene.resize(clientWidth, clientHeight);
    this.dirty = true;
  }

  play(on) {
    this.playing = on;
    this.last = null;
    this.dirty = true;
    if (!on && this.scene.sharpness < this.scene.sharpest) {
      this.scene.sharpness = this.scene.sharpest;
      this.resize();
    }
    if (on && this.time >= this.series.end) this.seek(0);
    const button = this.find("play");
    button.textContent = on ? "Pause" : "Play";
    button.setAttribute("aria-pressed", on);
  }

  seek(time) {
    this.time = Math.max(0, Math.min(this.series.end, time));
    this.dirty = true;
  }

  tick(now) {
    if (this.playing) {
      const passed = this.last ? Math.min(0.1, (now - this.last) / 1000) : 0;
      this.soften(passed);
      this.last = now;
      this.time += passed * this.series.end / film.PLAY_SECONDS[this.series.key];
      if (this.time >= this.series.end) { this.time = this.series.end; this.play(false); }
      this.dirty = true;
    }
    if (this.dirty && this.series) this.show();
    requestAnimationFrame((later) => this.tick(later));
  }

  // Fewer pixels where drawing is too slow for 30 pictures a second.
  soften(passed) {
    this.pace = 0.9 * (this.pace || 0.016) + 0.1 * passed;
    if (this.pace < 0.034 || this.scene.sharpness < 0.7) return;
    this.scene.sharpness *= 0.8;
    this.pace = 0.016;
    this.resize();
  }

  show() {
    const s = this.series;
    let k = 0;
    while (k + 2 < s.t.length && s.t[k + 1] <= this.time) k++;
    const between = Math.max(0, Math.min(1, (this.time - s.t[k]) / (s.t[k + 1] - s.t[k])));
    const factor = this.find("factor").value === "true" ? 1 : this.enlarged;
    this.scene.place(s, k, between);
    this.scene.placePlate(s, k, between, factor, this.maps[1], this.series.stressShown);
    const recent = 2 * s.end / s.t.length;
    this.scene.placeBreaks(s, k, this.time - recent, this.time, film.MODES);
    this.tint(k);
    this.scene.draw();
    this.label();
    this.dirty = false;
    this.frames++;
  }

  // Colours change only where a bond breaks, so they follow the instants and not every picture.
  tint(k) {
    const kind = this.find("colours").value, moment = `${kind} ${k}`;
    if (this.tinted === moment) return;
    this.tinted = moment;
    const write = { material: film.tintMaterial, damage: film.tintDamage, fragment: film.tintFragment }[kind];
    write(this.reel, this.time, this.scene.tint, this.reel.radius.length, this.maps[0]);
    this.scene.send(this.scene.parts.stones, "tint");
    for (const key of this.root.querySelectorAll("[data-key]")) key.hidden = key.dataset.key !== kind;
  }

  label() {
    film.moveCursor(this.find("curves"), this.time, this.series);
    const now = performance.now();
    if (this.playing && now - (this.labelled || 0) < 120) return; // text and slider cost more than the cursor
    this.labelled = now;
    const ms = 1e3 * this.time, broken = film.brokenCount(this.reel, this.time), total = this.reel.first.length;
    const digits = this.series.end < 0.005 ? 2 : 1;
    this.find("time").textContent = `${ms.toFixed(digits)} ms`;
    this.find("broken").textContent = total ? `${broken} of ${total} bonds broken` : "";
    const slider = this.find("slider");
    slider.value = slider.max * this.time / this.series.end;
    slider.setAttribute("aria-valuetext", `${ms.toFixed(digits)} ms`);
  }
};

film.tintMaterial = function (reel, time, tint, n) {
  for (let i = 0; i < n; i++) {
    const colour = film.MATERIALS[reel.gangue[i]], shade = 0.9 + 0.2 * ((i * 0.618) % 1);
    for (let d = 0; d < 3; d++) tint[3 * i + d] = Math.min(255, colour[d] * shade);
  }
};

film.tintDamage = function (reel, time, tint, n, map) {
  const damage = film.damage(reel, time);
  for (let i = 0; i < n; i++) {
    const c = 3 * Math.round(255 * damage[i]);
    for (let d = 0; d < 3; d++) tint[3 * i + d] = map[c + d];
  }
};

film.tintFragment = function (reel, time, tint, n) {
  const { root, largest } = film.fragments(reel, time);
  for (let i = 0; i < n; i++) {
    const whole = largest.has(root[i]), light = reel.gangue[i] ? 205 : 150;
    const colour = whole ? [light, light, light] : film.PIECES[root[i] % film.PIECES.length];
    for (let d = 0; d < 3; d++) tint[3 * i + d] = colour[d];
  }
};

// ---------------------------------------------------------------- curves

film.CURVES = [["force", "force on the plate, kN", 1e-3], ["acceleration", "plate's acceleration, m/s²", 1]];
film.BOX = { width: 600, height: 74, left: 4, right: 4 };

film.timeAt = function (share, series) {
  const { width, left, right } = film.BOX;
  return series.end * (share * width - left) / (width - left - right);
};

film.drawCurves = function (root, series) {
  const { width, height, left, right } = film.BOX, along = width - left - right;
  root.replaceChildren(...film.CURVES.filter(([name]) => series.curves[name]).map(([name, title, unit]) => {
    const { t, value } = series.curves[name];
    let low = 0, high = 0;
    for (const v of value) { low = Math.min(low, v); high = Math.max(high, v); }
    const span = high - low || 1, points = [];
    const shown = (v) => page.digits(unit * span * Math.round(1000 * v / span) / 1000);  // no more than can be seen
    for (let k = 0; k < t.length; k++) {
      points.push(`${(left + along * t[k] / series.end).toFixed(1)},${(3 + (height - 6) * (high - value[k]) / span).toFixed(1)}`);
    }
    const zero = (3 + (height - 6) * high / span).toFixed(1);
    const box = document.createElement("div");
    box.className = "curve";
    box.innerHTML = `<div class="curve-title"><span>${title}</span><span>${shown(low)} to ` +
      `${shown(high)}</span></div><svg viewBox="0 0 ${width} ${height}" preserveAspectRatio="none">` +
      `<line class="zero" x1="0" x2="${width}" y1="${zero}" y2="${zero}"/><polyline points="${points.join(" ")}"/>` +
      `</svg><i class="cursor"></i>`;
    return box;
  }));
};

// The cursor is moved and not drawn again: drawing the curves anew took twice as long as the three-dimensional view.
film.moveCursor = function (root, time, series) {
  const { width, left, right } = film.BOX, share = (left + (width - left - right) * time / series.end) / width;
  for (const cursor of root.querySelectorAll(".cursor")) {
    cursor.style.transform = `translateX(${(share * cursor.parentElement.clientWidth).toFixed(1)}px)`;
  }
};

addEventListener("DOMContentLoaded", async () => {
  const root = document.getElementById("film");
  try {
    film.player = new film.Player(root);
    await film.player.start();
  } catch (error) {
    root.querySelector("[data-film=no-view]").hidden = false;
    console.warn(`The three-dimensional view needs WebGL 2: ${error.message}`);
  }
});
