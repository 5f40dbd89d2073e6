// All that is known of one stone.

import { type Report, type Stones, covariance, isMeasured, norm } from "../data.ts";
import { button, el, svg } from "../dom.ts";
import { count, DASH, fixed, mm, percent, signedMm } from "../format.ts";
import { eigen3, ellipse } from "../geometry.ts";
import type { Store } from "../store.ts";
import { t } from "../texts.ts";
import type { Photos } from "./photos.ts";
import type { Sections } from "./sections.ts";
import type { Tracks } from "./tracks.ts";

/** 95 % quantile of chi-square with three degrees of freedom: the ellipsoid that the significance test is made of. */
const CHI2_3_95 = 7.814727903251179;
/** 95 % of a normal distribution lie within this many standard deviations. */
const QUANTILE = 1.96;
const NEIGHBOURS = 8;
const AXES = [t("along"), t("up"), t("out")] as const;

/** Cards that unpack what they show. */
export interface Cards {
  readonly photos: Photos;
  readonly tracks: Tracks;
  readonly sections: Sections;
}

/** The panel of the chosen stone. */
export class StonePanel {
  readonly element: HTMLElement;
  /** Says to screen readers which stone was chosen, in one sentence. */
  readonly announcer = el("p", { class: "announcer", role: "status" });
  readonly #report: Report;
  readonly #store: Store;
  readonly #cards: Cards;
  /** Stones in the order of the buttons: those that moved by size, then those above their limit by size, then the rest by id. */
  readonly #order: readonly number[];
  readonly #lineThrough: (stone: number, upright: boolean) => void;

  constructor(
    report: Report,
    store: Store,
    cards: Cards,
    lineThrough: (stone: number, upright: boolean) => void,
  ) {
    this.#report = report;
    this.#store = store;
    this.#cards = cards;
    this.#lineThrough = lineThrough;
    this.#order = byMotion(report.stones);
    this.element = el("div", { class: "stone-panel", role: "region", tabindex: 0, "aria-label": t("panelName") });
    store.on((state, before) => {
      if (state.chosen === before.chosen) return;
      this.#show(state.chosen);
      this.announcer.textContent = this.#sentence(state.chosen);
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
    parts.push(measured ? this.#numbers(stone) : this.#failure(stone), this.#cards.photos.of(stone),
      this.#cards.tracks.of(stone), this.#cards.sections.of(stone));
    if (measured && this.#report.document.sound) parts.push(this.#budget(stone), this.#ellipsoid(stone));
    parts.push(this.#neighbours(stone), this.#quality(stone));
    this.element.replaceChildren(...parts.filter((part) => part !== null));
  }

  #sentence(stone: number): string {
    return stone < 0 ? "" : stoneFacts(this.#report, stone);
  }

  #nothing(): Node {
    const start = button(t("largestMotion"), "", () => this.#step(-1, 1));
    return el("div", { class: "nothing" },
      el("p", {}, t("nothing")),
      el("p", {}, t("nothingDrag")),
      start);
  }

  #step(stone: number, by: number): void {
    const place = this.#order.indexOf(stone);
    const next = this.#order[(place + by + this.#order.length) % this.#order.length];
    if (next !== undefined) this.#store.choose(next);
  }

  #head(stone: number): Node {
    const { stones, document: { statuses, sound } } = this.#report;
    const badge = (text: string, kind: string) => el("span", { class: `badge ${kind}` }, text);
    const badges = !isMeasured(stones, stone) ? [badge(statuses[stones.state[stone]!]!.word, "weak")]
      : !sound ? [badge(t("badgeCannotTell"), "weak")]
      : [stones.moved[stone] ? badge(t("badgeMoved"), "strong") : badge(t(stones.significant[stone] ? "badgeAbove" : "badgeBelow"), "weak"),
        ...(stones.loose[stone] ? [badge(t("loose"), "alarm")] : [])];
    return el("div", { class: "stone-head" },
      el("div", { class: "stone-title" },
        el("h3", {}, t("stoneTitle", { id: stones.id[stone]! })),
        el("span", { class: "steps" },
          button("\u2190", t("previousStone"), () => this.#step(stone, -1)),
          button("\u2192", t("nextStone"), () => this.#step(stone, 1)),
          button("\u00d7", t("close"), () => this.#store.set({ chosen: -1 })))),
      el("p", { class: "badges" }, ...badges),
      el("p", { class: "note" }, t("place", { along: fixed(stones.a[stone]!, 2), up: fixed(stones.u[stone]!, 2) }),
        button(t("level"), "", () => this.#lineThrough(stone, false)), " ",
        button(t("upright"), "", () => this.#lineThrough(stone, true))));
  }

  #failure(stone: number): Node {
    const { stones, document: { statuses } } = this.#report;
    return el("p", {}, t("failure", { meaning: statuses[stones.state[stone]!]!.meaning }));
  }

  #numbers(stone: number): Node {
    const { stones, document: { registrationKnown, sound } } = this.#report;
    const cell = (text: string) => el("td", { class: "n" }, text);
    // Of a run in doubt neither intervals nor limits are given.
    const sure = (text: string) => (sound ? cell(text) : null);
    const row = (k: 0 | 1 | 2) =>
      el("tr", {}, el("th", { scope: "row" }, AXES[k]),
        cell(signedMm(stones.move[k][stone]!)), sure(`\u00b1 ${mm(QUANTILE * stones.sigma[k][stone]!)}`),
        cell(signedMm(stones.relative[k][stone]!)), cell(signedMrad(stones.rotation[k][stone]!)));
    const table = el("table", { class: "numbers" },
      el("thead", {}, el("tr", {}, ...[t("direction"), t("columnMotion"), ...(sound ? [t("column95")] : []), t("columnRelative"), t("columnRotation")].map((text, i) =>
        el("th", { scope: "col", ...(i ? { class: "n" } : {}) }, text)))),
      el("tbody", {}, row(0), row(1), row(2),
        el("tr", { class: "sum" }, el("th", { scope: "row" }, t("length")), cell(mm(norm(stones.move, stone))),
          sure(`LoD ${mm(stones.limit[stone]!)}`), cell(mm(norm(stones.relative, stone))),
          cell(fixed(norm(stones.rotation, stone) * 1e3, 2)))));
    return registrationKnown || !sound ? table : el("div", {}, table,
      el("p", { class: "note" }, t("unknownDatum")));
  }

  /** Where the standard deviations come from, the largest share first. */
  #budget(stone: number): Node | null {
    const { stones, document: { terms } } = this.#report;
    const sd = (metres: number) => el("td", { class: "n" }, mm(metres));
    const total = stones.sigma.reduce((sum, v) => sum + v[stone]! ** 2, 0);
    const square = (n: number) => stones.budget[n]!.reduce((sum, v) => sum + v[stone]! ** 2, 0);
    const shown = terms.map((_, n) => n).filter((n) => square(n) > 0).sort((a, b) => square(b) - square(a));
    if (shown.length === 0) return null;
    const row = (head: string, axes: readonly Float64Array[], part: number, kind = {}) =>
      el("tr", kind, el("th", { scope: "row" }, head), ...axes.map((v) => sd(v[stone]!)), el("td", { class: "n" }, percent(part / total)));
    return el("div", { class: "card" }, el("h4", {}, t("budgetTitle")),
      el("table", { class: "numbers" },
        el("thead", {}, el("tr", {}, ...[t("budgetTerm"), ...AXES, t("budgetShare")].map((text, i) =>
          el("th", { scope: "col", ...(i ? { class: "n" } : {}) }, text)))),
        el("tbody", {}, ...shown.map((n) => row(terms[n]!, stones.budget[n]!, square(n))),
          row(t("budgetSum"), stones.sigma, total, { class: "sum" }))),
      el("p", { class: "note" }, t("budgetNote")));
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
      vectorPlot(label, [d[x], d[1]], [c[x]![x]!, c[x]![1]!, c[1]![1]!], extent, larger, AXES[x]);
    const { values, vectors } = eigen3(c);
    const axes = values.map((v, k) => `${mm(Math.sqrt(CHI2_3_95 * Math.max(0, v)))} mm ${direction(vectors[k]!)}`);
    return el("div", { class: "card" }, el("h4", {}, t("ellipsoidTitle")),
      el("div", { class: "pair" }, plot(0, t("fromFront")), plot(2, t("fromSide"))),
      el("p", { class: "note" }, (larger > 1 ? t("enlarged", { n: larger }) : "") + t("halfAxes", { axes: axes.join(", "), share: percent(stones.observability[stone]!) })));
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
    return el("div", { class: "card" }, el("h4", {}, t("neighbours")),
      el("table", { class: "numbers" },
        el("thead", {}, el("tr", {}, ...[t("columnStone"), t("columnAway"), t("neighbourAlong"), t("neighbourUp"), t("neighbourOut")].map((text, i) =>
          el("th", { scope: "col", ...(i ? { class: "n" } : {}) }, text)))),
        el("tbody", {}, ...near.map(row))),
      el("p", { class: "note" }, t("neighboursNote")));
  }

  #quality(stone: number): Node {
    const { stones } = this.#report;
    const partner = stones.partner[stone]!;
    const facts: [string, string][] = [
      [t("points"), t("pointsText", { first: count(stones.points[0][stone]!), second: partner ? count(stones.points[1][stone]!) : t("none") })],
      [t("visibleFace"), `${fixed(stones.area[stone]! * 1e4, 0)} cm\u00b2`],
      [t("photos"), t("photosText", { n: stones.photos[stone]!, share: percent(stones.confidence[stone]!) })],
      [t("partner"), partner ? t("partnerText", { id: partner }) : t("noPartner")],
      [t("m3c2On"), Number.isNaN(stones.m3c2[stone]!) ? DASH : t("m3c2Text", { distance: signedMm(stones.m3c2[stone]!) })],
    ];
    return el("div", { class: "card" }, el("h4", {}, t("quality")),
      el("dl", {}, ...facts.flatMap(([term, text]) => [el("dt", {}, term), el("dd", {}, text)])));
  }
}

/** What is known of a stone in one sentence. */
export function stoneFacts(report: Report, stone: number): string {
  const { stones, document: { statuses, sound } } = report;
  const [along, up, out] = stones.move.map((d) => signedMm(d[stone]!));
  const limit = sound ? t("tipLimit", { limit: mm(stones.limit[stone]!) }) : "";
  const facts = isMeasured(stones, stone)
    ? t("tipFacts", { along: along!, up: up!, out: out! }) + limit
    : statuses[stones.state[stone]!]!.meaning;
  return t("stoneFacts", { id: stones.id[stone]!, facts });
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
  return radians > 0 && /[1-9]/.test(text) ? `+${text}` : text;
}

/** The axis that a unit vector is nearest to, in words. */
function direction(vector: readonly number[]): string {
  const k = vector.reduce((best, v, i) => (Math.abs(v) > Math.abs(vector[best]!) ? i : best), 0);
  return Math.abs(vector[k]!) > 0.9 ? AXES[k]! : t("mostly", { axis: AXES[k]! });
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
    svg("svg", { viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": `${title}: ${axis} ${signedMm(x)} mm, ${AXES[1]} ${signedMm(y)} mm` },
      ring((middle - 14) / 2), ring(middle - 14),
      svg("path", { d: `M0 ${middle}H${size}M${middle} 0V${size}`, class: "zero" }),
      svg("ellipse", { rx: Math.max(1, major * factor), ry: Math.max(1, minor * factor), class: "ellipse", transform: `translate(${px} ${py})rotate(${(-turn * 180) / Math.PI})` }),
      svg("path", { class: "vector", d: `M${middle} ${middle}L${px} ${py}M${px - bx - 0.6 * by} ${py - by + 0.6 * bx}L${px} ${py}L${px - bx + 0.6 * by} ${py - by - 0.6 * bx}` }),
      svg("text", { x: size - 2, y: middle - 4, "text-anchor": "end" }, axis),
      svg("text", { x: middle + 4, y: 10 }, AXES[1]),
      svg("text", { x: middle + 3, y: middle + (middle - 14) + 12 }, `${mm(extent)} mm`)),
    el("figcaption", { class: "note" }, title));
}
