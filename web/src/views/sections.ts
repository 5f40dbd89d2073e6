// The points of a stone in both epochs, cut along the wall and up the face.

import { type Report, isMeasured } from "../data.ts";
import type { Columns } from "../blocks.ts";
import { el, svg } from "../dom.ts";
import { decimalsOf, fixed, ticks } from "../format.ts";
import { t } from "../texts.ts";

/** A point of a section: place along it and height out of the face, metres. */
export type SectionPoint = readonly [place: number, out: number];

/** How a stone moved, in the face frame: metres, radians. */
export interface StoneMove {
  readonly move: readonly [number, number, number];
  readonly rotation: readonly [number, number, number];
}

/**
 * A point of the later epoch moved back by the stone's motion: the inverse of p + d + r x p for the small angles of
 * stones, in the plane of the section. `axis`: 0 for a level section, 1 for an upright one.
 */
export function movedBack([place, out]: SectionPoint, axis: 0 | 1, { move, rotation }: StoneMove): SectionPoint {
  const p = place - move[axis], n = out - move[2];
  // r x p with p = (a, 0, n) is (r_u n, ., -r_u a); with p = (0, u, n) it is (., -r_a n, r_a u).
  const turn = axis === 0 ? rotation[1] : -rotation[0];
  return [p - turn * n, n + turn * p];
}

/** Sections of the report. */
export class Sections {
  readonly #report: Report;
  readonly #columns: Promise<Columns | null> | null;
  #aligned = false;

  constructor(report: Report) {
    this.#report = report;
    this.#columns = report.document.blocks["sections"] ? report.block("sections") : null;
  }

  /** The card of a stone; `null` where the report has no sections or the stone no partner. */
  of(stone: number): Node | null {
    const { stones } = this.#report;
    if (!this.#columns || !stones.partner[stone]) return null;
    const place = el("div", {});
    const draw = async () => {
      const columns = await this.#columns;
      if (columns) place.replaceChildren(...([0, 1] as const).map((axis) => this.#chart(columns, stone, axis)));
    };
    const aligned = el("input", { type: "checkbox", id: "aligned", ...(this.#aligned ? { checked: true } : {}) });
    aligned.addEventListener("change", () => {
      this.#aligned = aligned.checked;
      void draw();
    });
    void draw();
    const [first, later] = this.#report.document.epochs;
    const moved = isMeasured(stones, stone);
    return el("div", { class: "card sections" }, el("h4", {}, t("sectionsTitle")),
      el("p", { class: "choices" }, el("span", {}, el("i", { class: "dot a" }), first), el("span", {}, el("i", { class: "dot b" }), later),
        moved ? el("label", {}, aligned, t("movedBack")) : null),
      place);
  }

  #run(columns: Columns, stone: number, run: number): SectionPoint[] {
    const end = columns.integers("end"), place = columns.numbers("place"), out = columns.numbers("out");
    const k = 4 * stone + run;
    const points: SectionPoint[] = [];
    for (let i = k === 0 ? 0 : end[k - 1]!; i < end[k]!; i++) points.push([place[i]!, out[i]!]);
    return points;
  }

  #chart(columns: Columns, stone: number, axis: 0 | 1): Node {
    const { stones } = this.#report;
    const three = (v: readonly Float64Array[]) => v.map((c) => c[stone]!) as [number, number, number];
    const motion: StoneMove = { move: three(stones.move), rotation: three(stones.rotation) };
    const first = this.#run(columns, stone, axis);
    const raw = this.#run(columns, stone, 2 + axis);
    const later = this.#aligned && isMeasured(stones, stone) ? raw.map((p) => movedBack(p, axis, motion)) : raw;
    // The frame holds the points before and after, so that the switch does not change the scale.
    const all = [...first, ...raw, ...raw.map((p) => movedBack(p, axis, motion)).filter((p) => !Number.isNaN(p[0]))];
    const range = (k: 0 | 1, share: number): [number, number] => {
      const values = all.map((p) => p[k]).sort((p, q) => p - q);
      if (values.length === 0) return [-0.1, 0.1];
      const at = (q: number) => values[Math.round(q * (values.length - 1))]!;
      const [low, high] = [at(share), at(1 - share)], margin = Math.max(0.06 * (high - low), 1e-3);
      return [low - margin, high + margin];
    };
    const [x0, x1] = range(0, 0), [y0, y1] = range(1, 0.005);
    const width = 372, height = 128, left = 40, right = 6, top = 6, bottom = 30;
    const x = (v: number) => left + ((v - x0) / (x1 - x0)) * (width - left - right);
    const y = (v: number) => top + ((y1 - v) / (y1 - y0)) * (height - top - bottom);
    const name = axis === 0 ? t("alongTheWall") : t("upTheFace");
    const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": t("section", { direction: name }) });
    const xs = ticks(x0 * 100, x1 * 100, 5), ys = ticks(y0 * 1e3, y1 * 1e3, 3);
    for (const t of ys) {
      picture.append(svg("path", { class: "grid", d: `M${left} ${y(t / 1e3)}H${width - right}` }),
        svg("text", { x: left - 5, y: y(t / 1e3) + 4, "text-anchor": "end" }, fixed(t, decimalsOf(ys))));
    }
    for (const t of xs) {
      picture.append(svg("path", { class: "grid", d: `M${x(t / 100)} ${top}V${height - bottom}` }),
        svg("text", { x: x(t / 100), y: height - bottom + 13, "text-anchor": "middle" }, fixed(t, decimalsOf(xs))));
    }
    picture.append(svg("text", { class: "label", x: (left + width - right) / 2, y: height - 3, "text-anchor": "middle" }, `${name}, cm`),
      svg("text", { class: "label", transform: `translate(10 ${(top + height - bottom) / 2})rotate(-90)`, "text-anchor": "middle" }, `${t("out")}, mm`));
    const dots = (points: readonly SectionPoint[], kind: string) => {
      const d = points.filter((p) => p[1] >= y0 && p[1] <= y1 && p[0] >= x0 && p[0] <= x1).map((p) => `M${x(p[0]).toFixed(1)} ${y(p[1]).toFixed(1)}h0`).join("");
      return svg("path", { class: `section-dots ${kind}`, d });
    };
    picture.append(dots(first, "a"), dots(later, "b"));
    return picture;
  }
}
