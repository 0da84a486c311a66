// Saving of figures and their data, values under the pointer, zoom, and the filters of the scoreboard.
"use strict";

const page = {};

page.save = function (name, url) {
  const link = document.createElement("a");
  link.download = name;
  link.href = url;
  link.click();
};

page.unpack = async function (text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).blob();
};

page.saveData = async function (button) {
  const packed = document.getElementById(`data-${button.dataset.csv}`).textContent;
  const url = URL.createObjectURL(new Blob([await page.unpack(packed)], { type: "text/csv" }));
  page.save(`${button.dataset.csv}.csv`, url);
  setTimeout(() => URL.revokeObjectURL(url), 10000);
};

page.filter = function (board) {
  const shown = new Set([...board.querySelectorAll("[data-verdict][aria-pressed=true]")].map((b) => b.dataset.verdict));
  const words = board.querySelector("input").value.toLowerCase();
  let count = 0;
  for (const row of board.querySelectorAll("tr[data-row]")) {
    row.hidden = !shown.has(row.dataset.row) || !row.textContent.toLowerCase().includes(words);
    count += !row.hidden;
  }
  board.querySelector("[data-count]").textContent = `${count} shown`;
};

// A link to a figure or to the scoreboard opens what is folded around its target.
page.open = function () {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folded = target && target.closest("details");
  if (folded) folded.open = true;
};

addEventListener("hashchange", page.open);
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => (d.open = true)));
addEventListener("DOMContentLoaded", () => {
  document.documentElement.classList.add("scripted");
  page.open();
  for (const button of document.querySelectorAll("[data-svg]")) {
    const image = document.getElementById(button.dataset.svg).querySelector("img");
    button.addEventListener("click", () => page.save(`${button.dataset.svg}.svg`, image.src));
  }
  for (const button of document.querySelectorAll("[data-csv]")) {
    button.addEventListener("click", () => page.saveData(button));
  }
  const board = document.getElementById("scoreboard");
  if (!board) return;
  for (const button of board.querySelectorAll("[data-verdict]")) {
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") !== "true");
      page.filter(board);
    });
  }
  board.querySelector("input").addEventListener("input", () => page.filter(board));
});

// Values under the pointer, and zoom: drag along a panel of a figure to see that stretch, double-click to see all again.
const plots = {};

// A number as short as a reader wants it: four digits, thousands not as powers of ten.
page.digits = function (value) {
  const size = Math.abs(value);
  if (size && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return String(Number(value.toPrecision(Math.max(4, Math.ceil(Math.log10(size + 1))))));
};

plots.SERIES = 12; // at most, named beside the pointer
plots.NS = "http://www.w3.org/2000/svg";

plots.Plot = class {
  constructor(root) {
    this.root = root;
    this.panels = JSON.parse(root.dataset.panels).filter((panel) => panel.box[2] > 0);
    if (!this.panels.some((panel) => panel.lines.length)) return;
    this.tip = root.appendChild(document.createElement("output"));
    this.tip.hidden = true;
    this.band = root.appendChild(document.createElement("i"));
    this.band.hidden = true;
    root.classList.add("read");
    root.addEventListener("pointermove", (e) => this.move(e));
    root.addEventListener("pointerdown", (e) => this.begin(e));
    root.addEventListener("pointerup", (e) => this.end(e));
    root.addEventListener("pointerleave", () => { this.tip.hidden = this.band.hidden = true; this.from = null; });
    root.addEventListener("dblclick", (e) => this.zoom(this.at(e)?.panel, null));
  }

  // Points of each line, from the figure's data: rows of `panel,series,x,y,value` in the order of the panels.
  async load() {
    const packed = document.getElementById(`data-${this.root.dataset.plot}`).textContent;
    const text = await (await page.unpack(packed)).text();
    const rows = text.split("\n").filter((row) => row && row[0] !== "#").slice(1);
    let next = 0;
    const number = (cell) => (cell === "" ? NaN : Number(cell));
    for (const panel of this.panels) {
      for (const line of panel.lines) {
        line.points = rows.slice(next, next += line[2]).map((row) => row.split(",").slice(-3).map(number));
      }
      next += panel.skip;
    }
    return this.panels;
  }

  // Panel and place, 0..1 to the right and upwards, of an event.
  at(event) {
    const box = this.root.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
    const panel = this.panels.find(({ box: [l, t, w, h], lines }) =>
      lines.length && x >= l - 0.01 && x <= l + w + 0.01 && y >= t && y <= t + h);
    if (!panel) return null;
    const [l, t, w, h] = panel.box;
    return { panel, x: Math.min(1, Math.max(0, (x - l) / w)), y: 1 - (y - t) / h, left: x * box.width, top: y * box.height,
      width: box.width };
  }

  async move(event) {
    const at = this.at(event);
    if (!at) { this.tip.hidden = this.band.hidden = true; return; }
    await (this.loaded ??= this.load());
    const { panel } = at, [l, t, w, h] = panel.box, range = panel.shown || panel;
    const dragged = this.from && this.from.panel === panel ? this.from.x : at.x;
    const [a, b] = [Math.min(dragged, at.x), Math.max(dragged, at.x)];
    Object.assign(this.band.style, { left: `${100 * (l + w * a)}%`, width: `max(1px, ${100 * w * (b - a)}%)`,
      top: `${100 * t}%`, height: `${100 * h}%` });
    const found = panel.lines.map(([name, colour, , steps, ], k) => ({ name, colour, point: plots.nearest(panel.lines[k].points, at, range, panel.log) }))
      .filter(({ point }) => point);
    if (!found.length) return;
    found.sort((p, q) => Math.abs(p.point.away) - Math.abs(q.point.away));
    const shown = found.slice(0, plots.SERIES).sort((p, q) => q.point.y - p.point.y);
    const x = document.createElement("b");
    x.textContent = `${page.digits(shown[0].point.x)}${panel.labels[0] ? ` (${panel.labels[0]})` : ""}`;
    this.tip.replaceChildren(x, ...shown.map(({ name, colour, point }) => {
      const line = document.createElement("span"), mark = document.createElement("i");
      mark.style.background = colour;
      const several = !/^line \d|^child/.test(name) && panel.lines.length > 1;
      line.append(mark, `${several ? `${name}: ` : ""}${page.digits(point.y)}`);
      return line;
    }));
    this.tip.hidden = this.band.hidden = false;
    const right = at.left > at.width / 2;
    Object.assign(this.tip.style, { left: right ? "auto" : `${at.left + 14}px`, right: right ? `${at.width - at.left + 14}px` : "auto",
      top: `${Math.max(0, at.top - 20)}px` });
  }

  begin(event) {
    this.from = this.at(event);
    if (this.from) event.preventDefault();
  }

  end(event) {
    const at = this.at(event), from = this.from;
    this.from = null;
    if (!at || !from || at.panel !== from.panel || Math.abs(at.x - from.x) * at.panel.box[2] * at.width < 8) return;
    const range = at.panel.shown || at.panel, along = (share) => plots.inverse(share, range.x, at.panel.log[0]);
    this.zoom(at.panel, [along(Math.min(at.x, from.x)), along(Math.max(at.x, from.x))]);
  }

  // Show a stretch of a panel, or all of it again; the values there fill the height.
  async zoom(panel, stretch) {
    if (!panel) return;
    await (this.loaded ??= this.load());
    panel.picture?.remove();
    panel.shown = null;
    if (!stretch) return;
    const inside = panel.lines.flatMap((line) => line.points).filter(([x, y]) => x >= stretch[0] && x <= stretch[1] && !isNaN(y));
    if (inside.length < 2) return;
    let low = Infinity, high = -Infinity;
    for (const [, y] of inside) { low = Math.min(low, y); high = Math.max(high, y); }
    const room = 0.06 * (high - low || Math.abs(high) || 1);
    panel.shown = { x: stretch, y: panel.log[1] ? [low / 1.2, high * 1.2] : [low - room, high + room] };
    panel.picture = this.root.appendChild(this.draw(panel));
  }

  draw(panel) {
    const [l, t, w, h] = panel.box, svg = document.createElementNS(plots.NS, "svg"), box = document.createElement("div");
    const share = (v, k) => plots.share(v, panel.shown[k], panel.log[k === "x" ? 0 : 1]);
    svg.setAttribute("viewBox", "0 0 1000 1000");
    svg.setAttribute("preserveAspectRatio", "none");
    for (const line of panel.lines) {
      const near = line.points.filter(([x], k, all) => all.length < 2 ||
        ((all[k + 1]?.[0] ?? x) >= panel.shown.x[0] && (all[k - 1]?.[0] ?? x) <= panel.shown.x[1]));
      const path = document.createElementNS(plots.NS, "polyline");
      path.setAttribute("points", near.filter(([, y]) => !isNaN(y)).flatMap(([x, y], k, all) => {
        const place = `${(1000 * share(x, "x")).toFixed(1)},${(1000 - 1000 * share(y, "y")).toFixed(1)}`;
        return line[3] && k ? [`${(1000 * share(x, "x")).toFixed(1)},${(1000 - 1000 * share(all[k - 1][1], "y")).toFixed(1)}`, place] : [place];
      }).join(" "));
      path.style.stroke = line[1];
      svg.append(path);
    }
    box.className = "zoomed";
    Object.assign(box.style, { left: `${100 * l}%`, top: `${100 * t}%`, width: `${100 * w}%`, height: `${100 * h}%` });
    box.append(svg);
    for (const [place, value] of [["x0", panel.shown.x[0]], ["x1", panel.shown.x[1]], ["y0", panel.shown.y[0]], ["y1", panel.shown.y[1]]]) {
      const text = box.appendChild(document.createElement("span"));
      text.className = place;
      text.textContent = page.digits(value);
    }
    return box;
  }
};

plots.share = (v, [low, high], log) => (log ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low));
plots.inverse = (s, [low, high], log) => (log ? low * (high / low) ** s : low + s * (high - low));

// The point of a line that is nearest along the panel to where the pointer is; `away`: how far it is up or down.
plots.nearest = function (points, at, range, log) {
  let best = null, least = 0.05;
  for (const [x, y] of points) {
    const aside = Math.abs(plots.share(x, range.x, log[0]) - at.x);
    if (aside < least && !isNaN(y)) { least = aside; best = { x, y }; }
  }
  if (best) best.away = plots.share(best.y, range.y, log[1]) - at.y;
  return best;
};

addEventListener("DOMContentLoaded", () => {
  plots.all = [...document.querySelectorAll("[data-plot]")].map((root) => new plots.Plot(root));
});
