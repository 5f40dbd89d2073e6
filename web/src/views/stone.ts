// All that is known of one stone.

import { type Report, type Stones, covariance, isMeasured, norm } from "../data.ts";
import { button, el, svg } from "../dom.ts";
import { count, DASH, fixed, mm, percent, signed, signedMm } from "../format.ts";
import { eigen3, ellipse } from "../geometry.ts";
import type { Store } from "../store.ts";
import type { Photos } from "./photos.ts";
import type { Sections } from "./sections.ts";

/** 95 % quantile of chi-square with three degrees of freedom: the ellipsoid that the significance test is made of. */
const CHI2_3_95 = 7.814727903251179;
/** 95 % of a normal distribution lie within this many standard deviations. */
const QUANTILE = 1.96;
const NEIGHBOURS = 8;
const AXES = ["along", "up", "out"] as const;

/** The panel of the chosen stone. */
export class StonePanel {
  readonly element: HTMLElement;
  readonly #report: Report;
  readonly #store: Store;
  readonly #photos: Photos;
  readonly #sections: Sections;
  /** Stones in the order of the buttons: those that moved by size, then those above their limit by size, then the rest by id. */
  readonly #order: readonly number[];
  readonly #lineThrough: (stone: number, upright: boolean) => void;

  constructor(
    report: Report,
    store: Store,
    photos: Photos,
    sections: Sections,
    lineThrough: (stone: number, upright: boolean) => void,
  ) {
    this.#report = report;
    this.#store = store;
    this.#photos = photos;
    this.#sections = sections;
    this.#lineThrough = lineThrough;
    this.#order = byMotion(report.stones);
    this.element = el("div", { class: "stone-panel", "aria-live": "polite" });
    store.on((state, before) => {
      if (state.chosen !== before.chosen) this.#show(state.chosen);
    });
    this.#show(store.get().chosen);
  }

  #show(stone: number): void {
    if (stone < 0) {
      this.element.replaceChildren(this.#nothing());
      return;
    }
    const { stones } = this.#report;
    const parts: (Node | null)[] = [this.#head(stone)];
    const measured = isMeasured(stones, stone);
    parts.push(measured ? this.#numbers(stone) : this.#failure(stone), this.#photos.of(stone), this.#sections.of(stone));
    if (measured) parts.push(this.#ellipsoid(stone));
    parts.push(this.#neighbours(stone), this.#quality(stone));
    this.element.replaceChildren(...parts.filter((part) => part !== null));
  }

  #nothing(): Node {
    const start = button("Largest motion", "choose the stone with the largest motion", () => this.#step(-1, 1));
    return el("div", { class: "nothing" },
      el("p", {}, "Choose a stone: click it on the map, or enter its number above. Its motion, uncertainty, photos, section and neighbours appear here."),
      el("p", {}, "Drag moves the map; the wheel zooms once the map was clicked; a double click zooms in."),
      start);
  }

  #step(stone: number, by: number): void {
    const place = this.#order.indexOf(stone);
    const next = this.#order[(place + by + this.#order.length) % this.#order.length];
    if (next !== undefined) this.#store.choose(next);
  }

  #head(stone: number): Node {
    const { stones, document: { statuses } } = this.#report;
    const badge = (text: string, kind: string) => el("span", { class: `badge ${kind}` }, text);
    const badges = isMeasured(stones, stone)
      ? [stones.moved[stone] ? badge("moved", "strong") : badge(stones.significant[stone] ? "above its limit" : "below its limit", "weak"),
        ...(stones.loose[stone] ? [badge("loose", "alarm")] : [])]
      : [badge(statuses[stones.state[stone]!]!.word, "weak")];
    return el("div", { class: "stone-head" },
      el("div", { class: "stone-title" },
        el("h3", {}, `Stone ${stones.id[stone]}`),
        el("span", { class: "steps" },
          button("\u2190", "previous stone, by size of motion", () => this.#step(stone, -1)),
          button("\u2192", "next stone, by size of motion", () => this.#step(stone, 1)),
          button("\u00d7", "close", () => this.#store.set({ chosen: -1 })))),
      el("p", { class: "badges" }, ...badges),
      el("p", { class: "note" }, `${fixed(stones.a[stone]!, 2)} m along, ${fixed(stones.u[stone]!, 2)} m up the face. Profile: `,
        button("level", "profile along a level line through this stone", () => this.#lineThrough(stone, false)), " ",
        button("upright", "profile along an upright line through this stone", () => this.#lineThrough(stone, true))));
  }

  #failure(stone: number): Node {
    const { stones, document: { statuses } } = this.#report;
    return el("p", {}, `Not measured: ${statuses[stones.state[stone]!]!.meaning}. Its motion is unknown, not zero.`);
  }

  #numbers(stone: number): Node {
    const { stones, document: { decimals, registrationKnown } } = this.#report;
    const mm = (metres: number) => fixed(metres * 1e3, decimals), signedMm = (metres: number) => signed(metres * 1e3, decimals);
    const cell = (text: string) => el("td", { class: "n" }, text);
    const row = (k: 0 | 1 | 2) =>
      el("tr", {}, el("th", { scope: "row" }, AXES[k]),
        cell(signedMm(stones.move[k][stone]!)), cell(`\u00b1 ${mm(QUANTILE * stones.sigma[k][stone]!)}`),
        cell(signedMm(stones.relative[k][stone]!)), cell(signedMrad(stones.rotation[k][stone]!)));
    const table = el("table", { class: "numbers" },
      el("thead", {}, el("tr", {}, ...["", "motion mm", "95 %", "against neighbours mm", "rotation mrad"].map((text, i) =>
        el("th", { scope: "col", ...(i ? { class: "n" } : {}) }, text)))),
      el("tbody", {}, row(0), row(1), row(2),
        el("tr", { class: "sum" }, el("th", { scope: "row" }, "length"), cell(mm(norm(stones.move, stone))),
          cell(`LoD ${mm(stones.limit[stone]!)}`), cell(mm(norm(stones.relative, stone))),
          cell(fixed(norm(stones.rotation, stone) * 1e3, 2)))));
    return registrationKnown ? table : el("div", {}, table,
      el("p", { class: "note" }, "95 % and LoD hold against the common motion of the measured stones: the registration error of the epochs is unknown."));
  }

  /** The displacement with the projections of its 95 % ellipsoid, from the front and from the side. */
  #ellipsoid(stone: number): Node {
    const { stones } = this.#report;
    const c = covariance(stones, stone);
    const d = stones.move.map((v) => v[stone]!) as [number, number, number];
    const reach = Math.sqrt(CHI2_3_95 * Math.max(c[0]![0]!, c[1]![1]!, c[2]![2]!));
    const longest = 1.1 * Math.max(...d.map(Math.abs), 1e-5);
    // An ellipsoid far smaller than the motion would be a dot.
    const larger = [1, 10, 100].find((f) => f * reach > 0.08 * longest) ?? 1000;
    const extent = longest + larger * reach;
    const plot = (x: 0 | 2, label: string) =>
      vectorPlot(label, [d[x], d[1]], [c[x]![x]!, c[x]![1]!, c[1]![1]!], extent, larger, x === 2 ? "out" : "along");
    const { values, vectors } = eigen3(c);
    const axes = values.map((v, k) => `${mm(Math.sqrt(CHI2_3_95 * Math.max(0, v)))} mm ${direction(vectors[k]!)}`);
    return el("div", { class: "card" }, el("h4", {}, "Error ellipsoid (95 %)"),
      el("div", { class: "pair" }, plot(0, "from the front"), plot(2, "from the side")),
      el("p", { class: "note" }, `${larger > 1 ? `Ellipsoid drawn ${larger} times larger than the motion. ` : ""}Half axes: ${axes.join(", ")}. Least observable direction seen to ${percent(stones.observability[stone]!)} by the stone's own points.`));
  }

  #neighbours(stone: number): Node | null {
    const { stones } = this.#report;
    const near = nearest(stones, stone, NEIGHBOURS);
    if (near.length === 0) return null;
    const row = (i: number) => {
      const link = el("a", { href: "#explore" }, String(stones.id[i]));
      link.addEventListener("click", (e) => {
        e.preventDefault();
        this.#store.choose(i);
      });
      const distance = Math.hypot(stones.a[i]! - stones.a[stone]!, stones.u[i]! - stones.u[stone]!);
      const difference = stones.move.map((v) => signedMm(v[i]! - v[stone]!));
      return el("tr", {}, el("td", {}, link), el("td", { class: "n" }, fixed(distance, 2)),
        ...difference.map((text) => el("td", { class: "n" }, text)));
    };
    return el("div", { class: "card" }, el("h4", {}, "Neighbours"),
      el("table", { class: "numbers" },
        el("thead", {}, el("tr", {}, ...["stone", "away m", "along mm", "up mm", "out mm"].map((text, i) =>
          el("th", { scope: "col", ...(i ? { class: "n" } : {}) }, text)))),
        el("tbody", {}, ...near.map(row))),
      el("p", { class: "note" }, "Their motion less this stone's."));
  }

  #quality(stone: number): Node {
    const { stones } = this.#report;
    const partner = stones.partner[stone]!;
    const facts: [string, string][] = [
      ["Points", `${count(stones.points[0][stone]!)} and ${partner ? count(stones.points[1][stone]!) : "none"}`],
      ["Visible face", `${fixed(stones.area[stone]! * 1e4, 0)} cm\u00b2`],
      ["Photos", `${stones.photos[stone]}, share of votes ${percent(stones.confidence[stone]!)}`],
      ["Partner", partner ? `stone ${partner} of the later epoch` : "none"],
      ["M3C2 on it", Number.isNaN(stones.m3c2[stone]!) ? DASH : `${signedMm(stones.m3c2[stone]!)} mm (median)`],
    ];
    return el("div", { class: "card" }, el("h4", {}, "Quality"),
      el("dl", {}, ...facts.flatMap(([term, text]) => [el("dt", {}, term), el("dd", {}, text)])));
  }
}

/** Indices of all stones: those that moved by size of motion, then those above their limit by size, then the others as they come. */
export function byMotion(stones: Stones): number[] {
  const all = Array.from({ length: stones.count }, (_, i) => i);
  const rank = (i: number) => stones.moved[i]! + stones.significant[i]!;
  const size = (i: number) => (stones.significant[i] ? norm(stones.move, i) : -1);
  return all.sort((p, q) => rank(q) - rank(p) || size(q) - size(p) || p - q);
}

/** The nearest stones on the wall, nearest first. */
export function nearest(stones: Stones, stone: number, wanted: number): number[] {
  const away = (i: number) => Math.hypot(stones.a[i]! - stones.a[stone]!, stones.u[i]! - stones.u[stone]!);
  const all: [number, number][] = [];
  for (let i = 0; i < stones.count; i++) {
    const d = away(i);
    if (i !== stone && Number.isFinite(d)) all.push([d, i]);
  }
  return all.sort((p, q) => p[0] - q[0]).slice(0, wanted).map(([, i]) => i);
}

function signedMrad(radians: number): string {
  const text = fixed(radians * 1e3, 2);
  return radians > 0 && Number(text) !== 0 ? `+${text}` : text;
}

/** The axis that a unit vector is nearest to, in words. */
function direction(vector: readonly number[]): string {
  const k = vector.reduce((best, v, i) => (Math.abs(v) > Math.abs(vector[best]!) ? i : best), 0);
  return Math.abs(vector[k]!) > 0.9 ? AXES[k]! : `mostly ${AXES[k]!}`;
}

/** A vector from the origin and the ellipse of its error around its tip. `c`: xx, xy, yy in m^2. */
function vectorPlot(title: string, [x, y]: [number, number], c: [number, number, number], extent: number, larger: number, axis: string): Node {
  const size = 170, middle = size / 2, scale = (middle - 14) / extent;
  const { major, minor, turn } = ellipse(...c);
  const factor = Math.sqrt(CHI2_3_95) * scale * larger;
  const [px, py] = [middle + x * scale, middle - y * scale];
  const length = Math.hypot(px - middle, py - middle) || 1;
  const head = Math.min(7, 0.5 * length) / length, [bx, by] = [(px - middle) * head, (py - middle) * head];
  const ring = (radius: number) => svg("circle", { cx: middle, cy: middle, r: radius, class: "grid" });
  return el("figure", {},
    svg("svg", { viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": `${title}: ${axis} ${signedMm(x)} mm, up ${signedMm(y)} mm` },
      ring((middle - 14) / 2), ring(middle - 14),
      svg("path", { d: `M0 ${middle}H${size}M${middle} 0V${size}`, class: "zero" }),
      svg("ellipse", { rx: Math.max(1, major * factor), ry: Math.max(1, minor * factor), class: "ellipse", transform: `translate(${px} ${py})rotate(${(-turn * 180) / Math.PI})` }),
      svg("path", { class: "vector", d: `M${middle} ${middle}L${px} ${py}M${px - bx - 0.6 * by} ${py - by + 0.6 * bx}L${px} ${py}L${px - bx + 0.6 * by} ${py - by - 0.6 * bx}` }),
      svg("text", { x: size - 2, y: middle - 4, "text-anchor": "end" }, axis),
      svg("text", { x: middle + 4, y: 10 }, "up"),
      svg("text", { x: middle + 3, y: middle + (middle - 14) + 12 }, `${mm(extent)} mm`)),
    el("figcaption", { class: "note" }, title));
}
