// Makes the page's own pictures answer: a dot of a scatter plot or a stone of a printed map leads to the stone.

import { type Report, ringOf } from "../data.ts";
import { svg } from "../dom.ts";
import { signedMm } from "../format.ts";
import { contains } from "../geometry.ts";
import type { Store } from "../store.ts";
import { t } from "../texts.ts";

/** Reach of the pointer, pixels of the picture. */
const REACH_PX = 9;

/** What a scatter plot shows of a stone, millimetres. The keys are those that `draw/chart.rs` writes. */
function plotted(report: Report, chart: string): ((i: number) => readonly [number, number]) | null {
  const { move, m3c2 } = report.stones;
  switch (chart) {
    case "in-plane": return (i) => [move[0][i]! * 1e3, move[1][i]! * 1e3];
    case "out-of-plane": return (i) => [move[2][i]! * 1e3, m3c2[i]! * 1e3];
    default: return null;
  }
}

/** Data ranges and area of a picture: x from, x to, y from, y to, left, top, width, height. */
function axes(picture: SVGSVGElement): { px: (x: number) => number; py: (y: number) => number; x: (px: number) => number; y: (py: number) => number } | null {
  const numbers = (picture.dataset["axes"] ?? "").split(" ").map(Number);
  if (numbers.length !== 8 || numbers.some(Number.isNaN)) return null;
  const [x0, x1, y0, y1, left, top, width, height] = numbers as [number, number, number, number, number, number, number, number];
  return {
    px: (x) => left + ((x - x0) / (x1 - x0)) * width,
    py: (y) => top + ((y1 - y) / (y1 - y0)) * height,
    x: (px) => x0 + ((px - left) / width) * (x1 - x0),
    y: (py) => y1 - ((py - top) / height) * (y1 - y0),
  };
}

/** Place of the pointer in the picture's own pixels. */
function pointer(picture: SVGSVGElement, e: MouseEvent): [number, number] {
  const box = picture.getBoundingClientRect(), view = picture.viewBox.baseVal;
  return [((e.clientX - box.left) / box.width) * view.width, ((e.clientY - box.top) / box.height) * view.height];
}

/** Connects all scatter plots and maps of the page. */
export function enliven(report: Report, store: Store): void {
  for (const picture of document.querySelectorAll<SVGSVGElement>("svg[data-chart]")) scatter(report, store, picture);
  for (const picture of document.querySelectorAll<SVGSVGElement>("svg[data-map]")) wall(report, store, picture);
}

function scatter(report: Report, store: Store, picture: SVGSVGElement): void {
  const frame = axes(picture), of = plotted(report, picture.dataset["chart"] ?? "");
  if (!frame || !of) return;
  const { stones } = report;
  const ring = (kind: string) => svg("circle", { r: 6, class: kind, visibility: "hidden" });
  const hover = ring("ring-hover"), chosen = ring("ring-chosen"), title = svg("title");
  picture.append(title, hover, chosen);
  const place = (circle: SVGCircleElement, stone: number) => {
    const [x, y] = stone < 0 ? [NaN, NaN] : of(stone);
    const shown = Number.isFinite(x) && Number.isFinite(y);
    circle.setAttribute("visibility", shown ? "visible" : "hidden");
    if (!shown) return;
    circle.setAttribute("cx", String(frame.px(x)));
    circle.setAttribute("cy", String(frame.py(y)));
  };
  const nearest = (e: MouseEvent): number => {
    const [px, py] = pointer(picture, e);
    let best = -1, least = REACH_PX;
    for (let i = 0; i < stones.count; i++) {
      const [x, y] = of(i);
      const away = Math.hypot(frame.px(x) - px, frame.py(y) - py);
      if (away < least) [best, least] = [i, away];
    }
    return best;
  };
  picture.addEventListener("pointermove", (e) => {
    const stone = nearest(e);
    place(hover, stone);
    title.textContent = stone < 0 ? "" : t("stoneFacts", { id: stones.id[stone]!, facts: of(stone).map((v) => `${signedMm(v / 1e3)} mm`).join(", ") });
    picture.style.cursor = stone < 0 ? "" : "pointer";
  });
  picture.addEventListener("pointerleave", () => place(hover, -1));
  picture.addEventListener("click", (e) => goTo(store, nearest(e)));
  store.on((state, before) => {
    if (state.chosen !== before.chosen) place(chosen, state.chosen);
  });
}

function wall(report: Report, store: Store, picture: SVGSVGElement): void {
  const frame = axes(picture);
  if (!frame) return;
  picture.style.cursor = "pointer";
  picture.addEventListener("click", (e) => {
    const [px, py] = pointer(picture, e), a = frame.x(px), u = frame.y(py);
    for (let i = 0; i < report.stones.count; i++) {
      if (contains(ringOf(report.stones, i), a, u)) return goTo(store, i);
    }
  });
}

/** Chooses a stone and scrolls to its panel. */
function goTo(store: Store, stone: number): void {
  if (stone < 0) return;
  store.choose(stone);
  document.getElementById("explore")?.scrollIntoView();
}
