// Motions along a line: every stone that the line crosses is a straight piece with its 95 % band.

import { type Report, isMeasured, ringOf } from "../data.ts";
import { button, el, svg } from "../dom.ts";
import { decimalsOf, fixed, niceAbove, signedMm, ticks } from "../format.ts";
import { crossings } from "../geometry.ts";
import type { Line, Store } from "../store.ts";
import { t } from "../texts.ts";

const QUANTILE = 1.96;
/** M3C2 core points within this distance of the line are shown, metres. */
const CHANGE_REACH_M = 0.08;
/** Narrowest and widest chart, pixels; wider pages enlarge it, narrower ones shrink it. */
const WIDTH_PX = [420, 1180] as const;
const NAMES = [t("along"), t("up"), t("out")] as const;

/** A stone under the line: from and to, metres from the line's start. */
export interface Step {
  readonly stone: number;
  readonly from: number;
  readonly to: number;
}

/** Stones that a line crosses, in its order. */
export function stepsAlong(report: Report, line: Line): Step[] {
  const { stones } = report;
  const steps: Step[] = [];
  for (let stone = 0; stone < stones.count; stone++) {
    for (const [from, to] of crossings(ringOf(stones, stone), line)) steps.push({ stone, from, to });
  }
  return steps.sort((p, q) => p.from - q.from);
}

/**
 * Motion of a stone at a place of the wall, metres: that of its centroid and what its rotation adds, d + r x p.
 * `axis`: 0 along, 1 up, 2 out.
 */
export function motionAt(report: Report, stone: number, axis: 0 | 1 | 2, a: number, u: number): number {
  const { stones } = report;
  const [da, du] = [a - stones.a[stone]!, u - stones.u[stone]!];
  const [ra, ru, rn] = stones.rotation.map((r) => r[stone]!) as [number, number, number];
  return stones.move[axis][stone]! + [-rn * du, rn * da, ra * du - ru * da][axis]!;
}

/** Distances from the line's start, and values in metres, of core points near a line. */
export function changeAlong(report: Report, { a1, u1, a2, u2 }: Line): { place: number; distance: number }[] {
  const { a, u, distance } = report.change;
  const length = Math.hypot(a2 - a1, u2 - u1) || 1, [dx, dy] = [(a2 - a1) / length, (u2 - u1) / length];
  const found: { place: number; distance: number }[] = [];
  for (let i = 0; i < a.length; i++) {
    const [x, y] = [a[i]! - a1, u[i]! - u1];
    const place = x * dx + y * dy;
    if (place >= 0 && place <= length && Math.abs(x * dy - y * dx) <= CHANGE_REACH_M) found.push({ place, distance: distance[i]! });
  }
  return found;
}

/** The charts under the map; empty while there is no line. */
export function profile(report: Report, store: Store): HTMLElement {
  const element = el("div", { class: "profile", hidden: true });
  const draw = () => {
    const line = store.get().profile;
    element.hidden = line === null;
    if (line) element.replaceChildren(...charts(report, store, line, Math.min(WIDTH_PX[1], Math.max(WIDTH_PX[0], element.clientWidth))));
    else element.replaceChildren();
  };
  let waiting = false;
  store.on((state, before) => {
    if (state.profile === before.profile || waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  });
  return element;
}

function charts(report: Report, store: Store, line: Line, width: number): Node[] {
  const steps = stepsAlong(report, line);
  const length = Math.hypot(line.a2 - line.a1, line.u2 - line.u1);
  const measured = steps.filter((s) => isMeasured(report.stones, s.stone));
  const head = el("p", { class: "profile-head" },
    el("b", {}, t("profileHead", { length: fixed(length, 2), n: new Set(measured.map((s) => s.stone)).size })),
    t("profileLines"),
    report.document.sound ? t("profileBands") : "",
    report.change.a.length ? t("profileDots") : "",
    button(t("closeProfile"), "", () => store.set({ profile: null })));
  return [head, ...([2, 0, 1] as const).map((axis) => chart(report, store, line, width, length, steps, axis))];
}

function chart(report: Report, store: Store, line: Line, width: number, length: number, steps: readonly Step[], axis: 0 | 1 | 2): Node {
  const { stones } = report;
  const height = axis === 2 ? 190 : 130, left = 58, right = 12, top = 8, bottom = axis === 1 ? 30 : 18;
  const change = axis === 2 ? changeAlong(report, line) : [];
  // Half the height of a stone's band, millimetres: a run in doubt has none.
  const half = (stone: number) => (report.document.sound ? QUANTILE * stones.sigma[axis][stone]! * 1e3 : 0);
  const bounds = steps.filter((s) => isMeasured(stones, s.stone)).flatMap(({ stone }) => {
    const [v, s] = [stones.move[axis][stone]! * 1e3, half(stone)];
    return [v - s, v + s];
  });
  const place = (m: number): [number, number] => {
    const t = m / length;
    return [line.a1 + t * (line.a2 - line.a1), line.u1 + t * (line.u2 - line.u1)];
  };
  const sorted = change.map((c) => c.distance * 1e3).sort((p, q) => p - q);
  bounds.push(0, ...[0.05, 0.95].map((q) => sorted[Math.floor(q * (sorted.length - 1))] ?? 0));
  let [low, high] = [Math.min(...bounds), Math.max(...bounds)];
  const margin = Math.max(0.05 * (high - low), niceAbove((high - low) / 50) / 2, 0.02);
  [low, high] = [low - margin, high + margin];
  const x = (m: number) => left + (m / length) * (width - left - right);
  const y = (v: number) => top + ((high - v) / (high - low)) * (height - top - bottom);
  const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": t("profileAxis", { axis: NAMES[axis] }) });
  const add = (...nodes: Node[]) => picture.append(...nodes);
  const yTicks = ticks(low, high, axis === 2 ? 5 : 3), xTicks = ticks(0, length, width / 95);
  for (const t of yTicks) {
    add(svg("path", { class: t === 0 ? "zero" : "grid", d: `M${left} ${y(t)}H${width - right}` }),
      svg("text", { x: left - 6, y: y(t) + 4, "text-anchor": "end" }, fixed(t, decimalsOf(yTicks))));
  }
  for (const t of xTicks) {
    add(svg("path", { class: "grid", d: `M${x(t)} ${top}V${height - bottom}` }));
    if (axis === 1) add(svg("text", { x: x(t), y: height - 12, "text-anchor": "middle" }, `${fixed(t, decimalsOf(xTicks))} m`));
  }
  add(svg("text", { class: "label", transform: `translate(13 ${(top + height - bottom) / 2})rotate(-90)`, "text-anchor": "middle" }, `${NAMES[axis]} mm`));
  for (const { place, distance } of change) {
    const v = distance * 1e3;
    if (v >= low && v <= high) add(svg("circle", { class: "change-dot", cx: x(place), cy: y(v), r: 1.6 }));
  }
  for (const { stone, from, to } of steps) {
    const [v, s] = [stones.move[axis][stone]! * 1e3, half(stone)];
    const [x0, x1] = [x(from), x(to)];
    const [v0, v1] = [from, to].map((m) => motionAt(report, stone, axis, ...place(m)) * 1e3) as [number, number];
    const mark = Number.isNaN(v)
      ? svg("rect", { class: "hatch", x: x0, y: top, width: x1 - x0, height: height - top - bottom })
      : svg("g", { class: "step" },
        svg("path", { class: "band", d: `M${x0} ${y(v0 + s)}L${x1} ${y(v1 + s)}V${y(v1 - s)}L${x0} ${y(v0 - s)}z` }),
        svg("path", { class: "line", d: `M${x0} ${y(v0)}L${x1} ${y(v1)}` }),
        svg("rect", { class: "catch", x: x0, y: top, width: x1 - x0, height: height - top - bottom }));
    const interval = report.document.sound ? ` \u00b1 ${fixed(s, 2)}` : "";
    mark.append(svg("title", {}, t("stoneFacts", { id: stones.id[stone]!, facts: Number.isNaN(v) ? t("unmeasured") : `${signedMm(v / 1e3)}${interval} mm` })));
    mark.addEventListener("pointerenter", () => store.set({ hover: stone }));
    mark.addEventListener("click", () => store.set({ chosen: stone }));
    add(mark);
  }
  return picture;
}
