// Unpacks what report/film/packing.py packed. A reel is one run: bodies, bonds, plate, and series of instants.
"use strict";

const film = {};

film.unpack = async function (text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
};

// Whole numbers over time: undo byte planes, zigzag and straight prediction. Arithmetic is modulo 2^16.
film.unpackMoving = async function (text, instants) {
  const bytes = new Uint8Array(await film.unpack(text));
  const count = bytes.length / 2, width = count / instants, values = new Int16Array(count);
  for (let i = 0; i < count; i++) {
    const zigzag = bytes[i] | (bytes[count + i] << 8);
    values[i] = (zigzag >> 1) ^ -(zigzag & 1);
  }
  for (let i = width; i < count; i++) {
    const before = values[i - width];
    values[i] += i < 2 * width ? before : 2 * before - values[i - 2 * width];
  }
  const rows = [];
  for (let k = 0; k < instants; k++) rows.push(values.subarray(k * width, (k + 1) * width));
  return rows;
};

film.curve = async function (packed) {
  return { t: new Float32Array(await film.unpack(packed.t)), value: new Float32Array(await film.unpack(packed.value)) };
};

film.readSeries = async function (packed) {
  const t = new Float32Array(await film.unpack(packed.t));
  return {
    key: packed.key, title: packed.title, end: packed.end, t,
    position: await film.unpackMoving(packed.position, t.length),
    deflection: await film.unpackMoving(packed.deflection, t.length), deflectionQuantum: packed.deflectionQuantum,
    stress: await film.unpackMoving(packed.stress, t.length), stressQuantum: packed.stressQuantum,
    stressShown: packed.stressShown,
    curves: Object.fromEntries(await Promise.all(Object.entries(packed.curves).map(
      async ([name, curve]) => [name, await film.curve(curve)]))),
  };
};

film.seriesOf = async function (reel, key) {
  if (!reel.series[key]) reel.series[key] = await film.readSeries(reel.packed.find((p) => p.key === key));
  return reel.series[key];
};

film.readReel = async function (id) {
  const packed = JSON.parse(document.getElementById(id).textContent);
  const b = packed.bodies, p = packed.plate;
  const reel = {
    quantum: packed.quantum,
    radius: new Float32Array(await film.unpack(b.radius)),
    gangue: new Uint8Array(await film.unpack(b.gangue)),
    stone: new Uint16Array(await film.unpack(b.stone)),
    first: new Uint32Array(await film.unpack(b.first)),
    second: new Uint32Array(await film.unpack(b.second)),
    brokenAt: new Float32Array(await film.unpack(b.brokenAt)),
    shear: new Uint8Array(await film.unpack(b.shear)),
    plate: { ...p, node: new Float32Array(await film.unpack(p.node)), quad: new Uint32Array(await film.unpack(p.quad)) },
    packed: packed.series, // unpacked into `series` when first asked for
    series: {},
  };
  reel.bondsOfEach = new Float32Array(reel.radius.length);
  for (let k = 0; k < reel.first.length; k++) {
    reel.bondsOfEach[reel.first[k]]++;
    reel.bondsOfEach[reel.second[k]]++;
  }
  return reel;
};

// ---------------------------------------------------------------- breakage at an instant

film.brokenCount = function (reel, time) {
  let count = 0;
  for (const t of reel.brokenAt) if (t <= time) count++;
  return count;
};

// Broken share of the bonds of each sub-sphere, 0..1, as analysis.sweep.breakage.damage.
film.damage = function (reel, time) {
  const damage = new Float32Array(reel.radius.length);
  for (let k = 0; k < reel.first.length; k++) {
    if (reel.brokenAt[k] > time) continue;
    damage[reel.first[k]]++;
    damage[reel.second[k]]++;
  }
  for (let i = 0; i < damage.length; i++) damage[i] /= Math.max(1, reel.bondsOfEach[i]);
  return damage;
};

// The fragment of each sub-sphere: what intact bonds hold together, by union-find. `root[i]` names it; `largest` holds
// the roots that are the largest piece of their stone.
film.fragments = function (reel, time) {
  const n = reel.radius.length, root = new Uint32Array(n);
  for (let i = 0; i < n; i++) root[i] = i;
  const find = (i) => {
    while (root[i] !== i) i = root[i] = root[root[i]];
    return i;
  };
  for (let k = 0; k < reel.first.length; k++) {
    if (reel.brokenAt[k] <= time) continue;
    const a = find(reel.first[k]), b = find(reel.second[k]);
    if (a < b) root[b] = a;
    else root[a] = b;
  }
  const volume = new Map(), best = new Map();
  for (let i = 0; i < n; i++) {
    root[i] = find(i);
    volume.set(root[i], (volume.get(root[i]) || 0) + reel.radius[i] ** 3);
  }
  for (const [r, v] of volume) {
    const stone = reel.stone[r];
    if (!best.has(stone) || v > volume.get(best.get(stone))) best.set(stone, r);
  }
  return { root, largest: new Set(best.values()), count: volume.size };
};
