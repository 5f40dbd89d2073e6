// Modules without a browser, against closed forms.
import assert from "node:assert/strict";
import { test } from "node:test";
import { gzipSync } from "node:zlib";
import { load } from "./load.mjs";

const { Columns, contains, count, crossings, eigen3, ellipse, faceAxes, fixed, mm, niceAbove, rotate, signedMm, ticks, unpack, Store, TABLE, compared, frame, movedBack, readTracks, shared } =
  await load(`
    export { Columns, unpack } from "./src/blocks.ts";
    export * from "./src/geometry.ts";
    export * from "./src/format.ts";
    export { Store } from "./src/store.ts";
    export { TABLE } from "./src/texts.ts";
    export { movedBack } from "./src/views/sections.ts";
    export { frame, readTracks } from "./src/views/tracks.ts";
    export { compared, shared } from "./studio/compared.ts";
  `);

test("columns come out of base64 of gzip, and missing values are NaN", async () => {
  const bytes = Buffer.alloc(12);
  bytes.writeInt32LE(1234, 0);
  bytes.writeInt32LE(-2147483648, 4);
  bytes.writeUInt8(200, 8);
  const entries = [
    { name: "d", type: "i32", unit: 1e-6, start: 0, length: 2 },
    { name: "flag", type: "u8", unit: 1, start: 8, length: 1 },
  ];
  const columns = await unpack(entries, gzipSync(bytes).toString("base64"));
  assert.ok(columns instanceof Columns);
  const d = columns.numbers("d");
  assert.ok(Math.abs(d[0] - 0.001234) < 1e-12 && Number.isNaN(d[1]));
  assert.equal(columns.integers("flag")[0], 200);
  assert.throws(() => columns.numbers("none"), /no column none/);
});

test("every language has every text, with the same values to fill in", () => {
  const braces = (text) => [...text.matchAll(/\{\w+\}/g)].map(String).sort().join();
  for (const [key, texts] of Object.entries(TABLE)) {
    assert.equal(texts.length, 3, key);
    assert.ok(texts.every((text) => text.trim() !== ""), key);
    for (const text of texts) assert.equal(braces(text), braces(texts[0]), key);
  }
});

test("numbers read as an engineer writes them", () => {
  assert.equal(fixed(-0.04, 1), "0.0");
  assert.equal(fixed(NaN, 1), "\u2013");
  assert.equal(mm(-0.0123), "\u221212.3");
  assert.equal(mm(0.0004), "0.40");
  assert.equal(mm(0.25), "250");
  assert.equal(signedMm(0.002), "+2.0");
  assert.equal(count(1234567), "1\u202f234\u202f567");
  assert.ok(Math.abs(niceAbove(0.23) - 0.25) < 1e-12);
  assert.deepEqual(ticks(-1, 4.2, 5), [0, 2, 4]);
});

test("a bay of a polygon is outside, and a line through it meets two pieces", () => {
  const u = [0, 0, 3, 0, 3, 2, 2, 2, 2, 1, 1, 1, 1, 2, 0, 2];
  assert.ok(contains(u, 0.5, 1.5) && !contains(u, 1.5, 1.5) && !contains(u, 4, 0.5));
  const pieces = crossings(u, { a1: -1, u1: 1.5, a2: 5, u2: 1.5 });
  assert.deepEqual(pieces, [[1, 2], [3, 4]]);
  // A line that begins inside starts at zero.
  assert.deepEqual(crossings(u, { a1: 0.5, u1: 0.5, a2: 0.5, u2: 9 }), [[0, 1.5]]);
});

test("eigenvalues and vectors rebuild a matrix that was turned", () => {
  const r = [0.3, -0.5, 0.8];
  const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((e) => rotate(e, r));
  const values = [9, 4, 1];
  const m = [0, 1, 2].map((i) => [0, 1, 2].map((j) => values.reduce((s, v, k) => s + v * columns[k][i] * columns[k][j], 0)));
  const found = eigen3(m);
  found.values.forEach((v, k) => assert.ok(Math.abs(v - values[k]) < 1e-9));
  found.vectors.forEach((v, k) => assert.ok(Math.abs(Math.abs(v.reduce((s, x, i) => s + x * columns[k][i], 0)) - 1) < 1e-9));
});

test("a quarter turn about z takes x to y", () => {
  const [x, y, z] = rotate([1, 0, 0], [0, 0, Math.PI / 2]);
  assert.ok(Math.hypot(x, y - 1, z) < 1e-12);
});

test("an ellipse of a covariance has its deviations as half axes", () => {
  const { major, minor, turn } = ellipse(4, 0, 1);
  assert.ok(Math.abs(major - 2) < 1e-12 && Math.abs(minor - 1) < 1e-12 && Math.abs(turn) < 1e-12);
  // Turned by 45 degrees: xx = yy = 2.5, xy = 1.5.
  assert.ok(Math.abs(ellipse(2.5, 1.5, 2.5).turn - Math.PI / 4) < 1e-12);
});

test("a face that looks along x has y to the right and z up", () => {
  const { along, up } = faceAxes([2, 0, 0]);
  assert.deepEqual(along.map((v) => v + 0), [0, 1, 0]);
  assert.ok(Math.hypot(up[0], up[1], up[2] - 1) < 1e-12);
});

test("listeners hear of changes and of nothing else", () => {
  const store = new Store({ chosen: -1, follow: 0 });
  let calls = 0;
  store.on(() => calls++);
  store.set({ chosen: -1 });
  store.set({ chosen: 3 });
  store.choose(3);
  assert.equal(calls, 2);
  assert.equal(store.get().follow, 1);
});

test("moving back undoes the rotation and displacement of a stone", () => {
  const rotation = [0.002, -0.003, 0.004], move = [0.01, -0.005, 0.03];
  const moved = (p) => rotate(p, rotation).map((v, k) => v + move[k]);
  const [a, , n] = moved([0.15, 0, 0.01]);
  const level = movedBack([a, n], 0, { move, rotation });
  assert.ok(Math.hypot(level[0] - 0.15, level[1] - 0.01) < 5e-6);
  const [, u, m] = moved([0, 0.12, -0.02]);
  const upright = movedBack([u, m], 1, { move, rotation });
  assert.ok(Math.hypot(upright[0] - 0.12, upright[1] + 0.02) < 5e-6);
});

test("a plot of shifts holds them, no motion and small ellipses, and cuts off a large one of the clouds", () => {
  const shift = (at, sd) => ({ at, covariance: [sd * sd, 0, sd * sd] });
  const shifts = [shift([0.004, 0.001], 0.0002), shift([-0.001, 0.002], 0.0002), null];
  const near = frame(shifts, null, 300, 200, true), far = frame(shifts, shift([0, 0], 0.1), 300, 200, true);
  for (const view of [near, far]) {
    assert.ok(view.low[0] < -0.001 - 2.4 * 0.0002 && view.high[0] > 0.004 + 2.4 * 0.0002 && view.low[1] < 0 && view.high[1] > 0.002 + 2.4 * 0.0002);
    assert.ok(Math.abs((view.high[0] - view.low[0]) * view.scale - 300) < 1e-9 && Math.abs((view.high[1] - view.low[1]) * view.scale - 200) < 1e-9);
  }
  assert.ok(far.scale > near.scale / 2.5, "a wide ellipse of the clouds does not make the shifts small");
});

test("tracked stones are unpacked with the shifts of their photos", () => {
  const values = {
    stone: [3, 8], shiftsEnd: [2, 2], edge: [0.3, NaN], photo1: [0, 0], photo2: [1, 0], later: [0, 1], photo: [0, 1], weight: [1, 0.5],
    along: [0.001, 0.002], up: [0, -0.001], sdAlong: [0.001, 0.001], sdUp: [0.002, 0.002], correlation: [0, 0.5],
  };
  for (const stem of ["clouds", "photos", "both"]) {
    for (const of of ["Along", "Up", "SdAlong", "SdUp", "Correlation"]) values[stem + of] = stem === "clouds" ? [0.5, NaN] : [0.25, 0.5];
  }
  const columns = { numbers: (name) => Float64Array.from(values[name]), integers: (name) => values[name] };
  const tracked = readTracks(columns);
  assert.deepEqual([tracked(3).place, tracked(8).place, tracked(4)], [0, -1, undefined]);
  assert.deepEqual([tracked(8).clouds, tracked(8).single.length], [null, 0]);
  assert.deepEqual(tracked(3).single[1], { at: [0.002, -0.001], covariance: [1e-6, 0.5 * 0.001 * 0.002, 4e-6], later: true, photo: 1, weight: 0.5 });
});

test("what a run changed is found by numbers and outlines", () => {
  const square = (x, y, side) => [[x, y], [x + side, y], [x + side, y + side], [x, y + side]];
  const report = (stones) => {
    const ids = Object.keys(stones).map(Number), rings = Object.values(stones);
    let end = 0;
    return {
      indexOfId: new Map(ids.map((id, i) => [id, i])),
      stones: { a: new Float64Array(ids.length), u: new Float64Array(ids.length), ring: Float64Array.from(rings.flat(2)), ringEnd: rings.map((ring) => (end += ring.length)) },
    };
  };
  const before = report({ 1: square(0, 0, 1), 2: square(1, 0, 1), 3: square(2, 0, 1), 4: square(5, 5, 1) });
  // 1 takes in 2, 3 loses an edge of 2 %, 4 is untouched, 5 is new.
  const after = report({ 1: [[0, 0], [2, 0], [2, 1], [0, 1]], 3: [[2, 0], [2.98, 0], [2.98, 1], [2, 1]], 4: square(5, 5, 1), 5: square(7, 0, 1) });
  const found = compared(before, after);
  assert.deepEqual(found.map(({ fate, stones }) => [fate, ...stones]), [["changed", 1], ["new", 5], ["gone", 2]]);
  assert.deepEqual(found[2].outline, square(1, 0, 1));
  assert.ok(Math.abs(shared([0, 0, 2, 0, 2, 1, 0, 1], [0, 0, 1, 0, 1, 1, 0, 1]) - 0.5) < 0.03);
});
