// Plane geometry and small matrices.

import type { Line } from "./store.ts";

/** Whether a polygon (x, y, x, y, ...) holds a point, by crossings (even-odd rule). */
export function contains(ring: ArrayLike<number>, x: number, y: number): boolean {
  let inside = false;
  for (let a = 0, b = ring.length - 2; a < ring.length; b = a, a += 2) {
    const [xa, ya, xb, yb] = [ring[a]!, ring[a + 1]!, ring[b]!, ring[b + 1]!];
    if (ya > y !== yb > y && x < xa + ((xb - xa) * (y - ya)) / (yb - ya)) inside = !inside;
  }
  return inside;
}

/** Where a line runs through a polygon: pairs of distances from the line's start, ascending. */
export function crossings(ring: ArrayLike<number>, line: Line): [number, number][] {
  const dx = line.a2 - line.a1, dy = line.u2 - line.u1;
  const length = Math.hypot(dx, dy);
  if (length === 0 || ring.length < 6) return [];
  const places: number[] = [];
  const side = (x: number, y: number) => (x - line.a1) * dy - (y - line.u1) * dx;
  for (let a = 0, b = ring.length - 2; a < ring.length; b = a, a += 2) {
    const sa = side(ring[a]!, ring[a + 1]!), sb = side(ring[b]!, ring[b + 1]!);
    if (sa > 0 === sb > 0) continue;
    const t = sa / (sa - sb);
    const x = ring[a]! + t * (ring[b]! - ring[a]!), y = ring[a + 1]! + t * (ring[b + 1]! - ring[a + 1]!);
    places.push(((x - line.a1) * dx + (y - line.u1) * dy) / length);
  }
  places.sort((p, q) => p - q);
  const pairs: [number, number][] = [];
  for (let k = 0; k + 1 < places.length; k += 2) {
    const from = Math.max(0, places[k]!), to = Math.min(length, places[k + 1]!);
    if (to > from) pairs.push([from, to]);
  }
  return pairs;
}

/** Eigenvalues, descending, and unit eigenvectors of a symmetric 3 x 3 matrix (cyclic Jacobi). */
export function eigen3(matrix: readonly (readonly number[])[]): { values: number[]; vectors: number[][] } {
  const m = matrix.map((row) => [...row]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 30; sweep++) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]] as const) {
      if (Math.abs(m[p]![q]!) < 1e-30) continue;
      const angle = 0.5 * Math.atan2(2 * m[p]![q]!, m[q]![q]! - m[p]![p]!);
      const c = Math.cos(angle), s = Math.sin(angle);
      for (let k = 0; k < 3; k++) {
        const [kp, kq] = [m[k]![p]!, m[k]![q]!];
        m[k]![p] = c * kp - s * kq;
        m[k]![q] = s * kp + c * kq;
      }
      for (let k = 0; k < 3; k++) {
        const [pk, qk] = [m[p]![k]!, m[q]![k]!];
        m[p]![k] = c * pk - s * qk;
        m[q]![k] = s * pk + c * qk;
      }
      for (let k = 0; k < 3; k++) {
        const [kp, kq] = [v[k]![p]!, v[k]![q]!];
        v[k]![p] = c * kp - s * kq;
        v[k]![q] = s * kp + c * kq;
      }
    }
  }
  const order = [0, 1, 2].sort((a, b) => m[b]![b]! - m[a]![a]!);
  return { values: order.map((k) => m[k]![k]!), vectors: order.map((k) => v.map((row) => row[k]!)) };
}

/** Half axes and turn (radians, from x towards y) of the ellipse x' C^-1 x = 1 of a 2 x 2 covariance. */
export function ellipse(xx: number, xy: number, yy: number): { major: number; minor: number; turn: number } {
  const middle = (xx + yy) / 2, half = Math.hypot((xx - yy) / 2, xy);
  return {
    major: Math.sqrt(Math.max(0, middle + half)),
    minor: Math.sqrt(Math.max(0, middle - half)),
    turn: 0.5 * Math.atan2(2 * xy, xx - yy),
  };
}

/** Turns a vector by a rotation vector (Rodrigues). */
export function rotate([x, y, z]: readonly number[], [rx, ry, rz]: readonly number[]): [number, number, number] {
  const angle = Math.hypot(rx!, ry!, rz!);
  if (angle < 1e-12) return [x!, y!, z!];
  const [kx, ky, kz] = [rx! / angle, ry! / angle, rz! / angle];
  const c = Math.cos(angle), s = Math.sin(angle), d = (kx * x! + ky * y! + kz * z!) * (1 - c);
  return [
    x! * c + (ky * z! - kz * y!) * s + kx * d,
    y! * c + (kz * x! - kx * z!) * s + ky * d,
    z! * c + (kx * y! - ky * x!) * s + kz * d,
  ];
}

/** Axes of a face with this outward normal: along (level, to the right of a viewer in front) and up the face. */
export function faceAxes([nx, ny, nz]: readonly number[]): { along: number[]; up: number[]; out: number[] } {
  const size = Math.hypot(nx!, ny!, nz!) || 1;
  const out = [nx! / size, ny! / size, nz! / size];
  const level = Math.hypot(out[0]!, out[1]!);
  const along = level > 1e-9 ? [-out[1]! / level, out[0]! / level, 0] : [1, 0, 0];
  const up = [
    out[1]! * along[2]! - out[2]! * along[1]!,
    out[2]! * along[0]! - out[0]! * along[2]!,
    out[0]! * along[1]! - out[1]! * along[0]!,
  ];
  return { along, up, out };
}

/** Things on the wall by squares, to find those at or near a place. */
export class Squares {
  readonly #edge: number;
  readonly #squares = new Map<number, number[]>();

  constructor(edge: number) {
    this.#edge = edge;
  }

  /** Adds an item to every square that its box touches. */
  add(item: number, left: number, low: number, right: number, high: number): void {
    for (let x = Math.floor(left / this.#edge); x <= Math.floor(right / this.#edge); x++) {
      for (let y = Math.floor(low / this.#edge); y <= Math.floor(high / this.#edge); y++) {
        const key = x * 1_000_003 + y;
        const square = this.#squares.get(key);
        if (square) square.push(item);
        else this.#squares.set(key, [item]);
      }
    }
  }

  /** Items of the square at a place. */
  at(x: number, y: number): readonly number[] {
    return this.#squares.get(Math.floor(x / this.#edge) * 1_000_003 + Math.floor(y / this.#edge)) ?? [];
  }
}
