// What a run changed: the stones of the results before it and after it.

import { type Report, ringOf } from "../src/data.ts";
import { contains } from "../src/geometry.ts";
import type { StoneChange } from "./api.ts";

/** Outlines that share less of their area than this differ (IoU). */
const SAME = 0.95;
/** Places along each side of a box at which two outlines are compared. */
const PLACES = 24;

/** The stones of the first epoch that are new, gone, or have another border. */
export function compared(before: Report, after: Report): StoneChange[] {
  const changes: StoneChange[] = [];
  const outline = ({ stones }: Report, i: number): [number, number][] => {
    const ring = ringOf(stones, i);
    return Array.from({ length: ring.length / 2 }, (_, k) => [ring[2 * k]!, ring[2 * k + 1]!]);
  };
  for (const [id, now] of after.indexOfId) {
    const then = before.indexOfId.get(id);
    const fate = then === undefined ? "new" : shared(ringOf(before.stones, then), ringOf(after.stones, now)) < SAME ? "changed" : null;
    if (fate) changes.push({ fate, outline: outline(after, now), stones: [id] });
  }
  for (const [id, then] of before.indexOfId) {
    if (!after.indexOfId.has(id)) changes.push({ fate: "gone", outline: outline(before, then), stones: [id] });
  }
  return changes;
}

/** The share of the area of two polygons that both have (IoU), from places on a grid. */
export function shared(first: ArrayLike<number>, second: ArrayLike<number>): number {
  const isSame = first.length === second.length && Array.prototype.every.call(first, (value, k) => value === second[k]);
  if (isSame) return 1;
  const all = [...Array.from(first), ...Array.from(second)];
  const [xs, ys] = [all.filter((_, k) => k % 2 === 0), all.filter((_, k) => k % 2 === 1)];
  const [left, low, right, high] = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  let both = 0, either = 0;
  for (let n = 0; n < PLACES * PLACES; n++) {
    const x = left + ((n % PLACES) + 0.5) * ((right - left) / PLACES), y = low + (Math.floor(n / PLACES) + 0.5) * ((high - low) / PLACES);
    const [one, other] = [contains(first, x, y), contains(second, x, y)];
    if (one || other) either++;
    if (one && other) both++;
  }
  return either > 0 ? both / either : 1;
}
