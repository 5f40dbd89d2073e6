// What photos show of a stone: the matched faces, the shift of each photo, and what clouds and photos say each alone.

import type { Columns } from "../blocks.ts";
import type { Report } from "../data.ts";
import { el, embedded, svg } from "../dom.ts";
import { decimalsOf, fixed, signedMm, mm, ticks } from "../format.ts";
import { ellipse } from "../geometry.ts";
import { type TextKey, t } from "../texts.ts";

/** 95 % quantile of chi-square with two degrees of freedom. */
const CHI2_2_95 = 5.991464547107979;
/** 95 % of a normal distribution lie within this many standard deviations. */
const QUANTILE = 1.96;
/** Pictures of a stone: before, after, difference. */
const PICTURES = 3;
/** A dot below this share of full weight is not drawn paler: it must stay visible. */
const PALEST = 0.25;
/** What a stone's status means; the first two need no words. `page/tracked.rs` numbers them. */
const REASONS: readonly (TextKey | null)[] = [null, null, "fewPhotos", "smallFace", "noTemplate", "notFound", "ambiguous"];

/** A displacement in the face: metres, covariance xx, xy, yy in m^2. */
export interface Shift {
  readonly at: readonly [along: number, up: number];
  readonly covariance: readonly [number, number, number];
}

/** What one photo shows. */
export interface PhotoShift extends Shift {
  readonly later: boolean;
  readonly photo: number;
  readonly weight: number;
}

/** A tracked stone. */
export interface Tracked {
  /** Place of its pictures among all that have pictures; -1 for none. */
  readonly place: number;
  readonly photos: readonly [number, number];
  readonly clouds: Shift | null;
  readonly together: Shift | null;
  readonly both: Shift | null;
  readonly single: readonly PhotoShift[];
}

/** The tracked stones of the report. */
export class Tracks {
  readonly #report: Report;
  readonly #stones: Promise<{ readonly status: ArrayLike<number>; readonly tracked: (stone: number) => Tracked | undefined } | null> | null;
  readonly #pictures: Promise<HTMLImageElement>[] = [];

  constructor(report: Report) {
    this.#report = report;
    this.#stones = report.document.blocks["tracks"]
      ? report.block("tracks").then((columns) => (columns ? { status: columns.integers("status"), tracked: readTracks(columns) } : null))
      : null;
  }

  /** The card of a stone; `null` where photos took no part. */
  of(stone: number): Node | null {
    if (!this.#stones) return null;
    const card = el("div", { class: "card tracks" });
    void this.#stones.then((stones) => {
      if (stones) this.#fill(card, stone, stones.tracked(stone), stones.status[stone]!);
    });
    return card;
  }

  #fill(card: HTMLElement, stone: number, tracked: Tracked | undefined, status: number): void {
    const reason = REASONS[status];
    if (reason) card.append(el("h4", {}, t("tracksEach")), el("p", { class: "note" }, t("notTracked", { reason: t(reason) })));
    if (!tracked) return;
    card.append(el("h4", {}, t("tracksTitle")), this.#pictured(stone, tracked), el("h4", {}, t("tracksEach")), this.#plot(tracked), this.#table(tracked));
  }

  #pictured(stone: number, tracked: Tracked): Node {
    const { tracks, epochs } = this.#report.document;
    if (!tracks || tracked.place < 0) return el("p", { class: "note" }, t("tracksNoPicture"));
    const name = (epoch: 0 | 1) => `${epochs[epoch]}: ${tracks.photos[tracked.photos[epoch]] ?? ""}`;
    const labels = [t("tracksPicture", { epoch: epochs[0] }), t("tracksPicture", { epoch: epochs[1] }), t("tracksDifference")];
    const captions = [name(0), name(1), t("tracksCaption")];
    return el("div", {}, el("div", { class: "triple" }, ...labels.map((label, k) => {
      const canvas = el("canvas", { width: tracks.side, height: tracks.side, role: "img", "aria-label": label });
      void this.#draw(canvas, PICTURES * tracked.place + k).then(() => (canvas.dataset["drawn"] = String(stone)));
      return el("figure", {}, canvas, el("figcaption", { class: "note" }, captions[k]!));
    })), el("p", { class: "note" }, t("tracksSame")));
  }

  async #draw(canvas: HTMLCanvasElement, slot: number): Promise<void> {
    const { side, perRow } = this.#report.document.tracks!;
    const number = Math.floor(slot / (perRow * perRow)), within = slot % (perRow * perRow);
    const picture = await (this.#pictures[number] ??= embedded(`tracks-${number}`));
    canvas.getContext("2d")!.drawImage(picture, (within % perRow) * side, Math.floor(within / perRow) * side, side, side, 0, 0, side, side);
  }

  #table(tracked: Tracked): Node {
    const { sound } = this.#report.document;
    const rows: [TextKey, Shift | null][] = [["tracksClouds", tracked.clouds], ["tracksPhotos", tracked.together], ["tracksBoth", tracked.both]];
    const cell = (text: string) => el("td", { class: "n" }, text);
    const sure = (variance: number) => (sound ? cell(`\u00b1 ${mm(QUANTILE * Math.sqrt(variance))}`) : null);
    const heads = [t("tracksSource"), t("tracksAlong"), ...(sound ? [t("column95")] : []), t("tracksUp"), ...(sound ? [t("column95")] : [])];
    return el("div", {}, el("table", { class: "numbers" },
      el("thead", {}, el("tr", {}, ...heads.map((text, i) => el("th", { scope: "col", ...(i ? { class: "n" } : {}) }, text)))),
      el("tbody", {}, ...rows.flatMap(([key, shift]) => (shift ? [el("tr", {}, el("th", { scope: "row" }, t(key)),
        cell(signedMm(shift.at[0])), sure(shift.covariance[0]), cell(signedMm(shift.at[1])), sure(shift.covariance[2]))] : [])))),
      el("p", { class: "note" }, t(sound ? "tracksNote" : "tracksNoteDoubt")));
  }

  #plot(tracked: Tracked): Node {
    const { sound, epochs } = this.#report.document;
    const { both } = tracked;
    const width = 372, height = 250, left = 40, right = 8, top = 8, bottom = 34;
    const view = frame([...tracked.single, tracked.together, both], tracked.clouds, width - left - right, height - top - bottom, sound);
    const x = (v: number) => left + (v - view.low[0]) * view.scale, y = (v: number) => height - bottom - (v - view.low[1]) * view.scale;
    const ring = (shift: Shift, kind: string) => {
      const { major, minor, turn } = ellipse(...shift.covariance), factor = Math.sqrt(CHI2_2_95) * view.scale;
      return svg("ellipse", { rx: (major * factor).toFixed(2), ry: (minor * factor).toFixed(2), class: `ellipse ${kind}`,
        transform: `translate(${x(shift.at[0]).toFixed(2)} ${y(shift.at[1]).toFixed(2)})rotate(${((-turn * 180) / Math.PI).toFixed(1)})` });
    };
    const inside = svg("svg", { x: left, y: top, width: width - left - right, height: height - top - bottom, viewBox: `${left} ${top} ${width - left - right} ${height - top - bottom}` },
      svg("path", { class: "zero", d: `M${x(0)} ${top}V${height - bottom}M${left} ${y(0)}H${width - right}` }));
    if (sound) {
      for (const shift of tracked.single) inside.append(ring(shift, `single ${shift.later ? "b" : "a"}`));
      if (tracked.clouds) inside.append(ring(tracked.clouds, "clouds"));
      if (tracked.together) inside.append(ring(tracked.together, "photos"));
      if (both) inside.append(ring(both, "both"));
    }
    for (const { at, later, weight } of tracked.single) {
      inside.append(svg("circle", { cx: x(at[0]).toFixed(2), cy: y(at[1]).toFixed(2), r: 2.6, class: `photo-dot ${later ? "b" : "a"}`, opacity: Math.max(PALEST, Math.min(1, weight)).toFixed(2) }));
    }
    for (const [shift, kind] of [[tracked.clouds, "clouds"], [tracked.together, "photos"], [both, "both"]] as const) {
      if (shift) inside.append(mark(kind, x(shift.at[0]), y(shift.at[1])));
    }
    const label = (v: number, all: readonly number[]) => fixed(v, decimalsOf(all));
    const alongs = ticks(view.low[0] * 1e3, view.high[0] * 1e3, 6), ups = ticks(view.low[1] * 1e3, view.high[1] * 1e3, 4);
    const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": t("tracksPlot") },
      ...alongs.map((v) => svg("path", { class: "grid", d: `M${x(v / 1e3)} ${top}V${height - bottom}` })),
      ...ups.map((v) => svg("path", { class: "grid", d: `M${left} ${y(v / 1e3)}H${width - right}` })),
      inside,
      ...alongs.map((v) => svg("text", { x: x(v / 1e3), y: height - bottom + 13, "text-anchor": "middle" }, label(v, alongs))),
      ...ups.map((v) => svg("text", { x: left - 4, y: y(v / 1e3) + 4, "text-anchor": "end" }, label(v, ups))),
      svg("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, `${t("along")}, mm`),
      svg("text", { x: 10, y: (top + height - bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 10 ${(top + height - bottom) / 2})` }, `${t("up")}, mm`));
    const key = (kind: string, text: string) => el("span", {}, symbol(kind), text);
    return el("div", {}, picture, el("p", { class: "choices" },
      key("a", t("tracksPhotosOf", { epoch: epochs[0] })), key("b", t("tracksPhotosOf", { epoch: epochs[1] })),
      ...(tracked.clouds ? [key("clouds", t("tracksClouds"))] : []), ...(tracked.together ? [key("photos", t("tracksPhotos"))] : []),
      ...(both ? [key("both", t("tracksBoth"))] : [])));
  }
}

/**
 * The part of the plane that a plot shows: all shifts with their ellipses and no motion; the ellipse of the clouds as far as it does not make the others
 * small. Equal scales in both directions.
 */
export function frame(shifts: readonly (Shift | null)[], clouds: Shift | null, width: number, height: number, ellipses: boolean) {
  const low: [number, number] = [0, 0], high: [number, number] = [0, 0];
  const reach = (shift: Shift, k: 0 | 1) => (ellipses ? Math.sqrt(CHI2_2_95 * shift.covariance[k === 0 ? 0 : 2]) : 0);
  const include = (shift: Shift, most: number) => {
    for (const k of [0, 1] as const) {
      const r = Math.min(most, reach(shift, k));
      low[k] = Math.min(low[k], shift.at[k] - r);
      high[k] = Math.max(high[k], shift.at[k] + r);
    }
  };
  for (const shift of shifts) if (shift) include(shift, Infinity);
  if (clouds) include(clouds, 0.5 * Math.max(high[0] - low[0], high[1] - low[1]));
  const span = ([0, 1] as const).map((k) => 1.1 * Math.max(high[k] - low[k], 5e-4));
  const scale = Math.min(width / span[0]!, height / span[1]!);
  const middle = ([0, 1] as const).map((k) => (low[k] + high[k]) / 2);
  const half = [width / scale / 2, height / scale / 2];
  const ends = (sign: number) => [middle[0]! + sign * half[0]!, middle[1]! + sign * half[1]!] as const;
  return { low: ends(-1), high: ends(1), scale };
}

/** What is marked: clouds by a square, photos by a ring, both by a cross. */
function mark(kind: "clouds" | "photos" | "both", x: number, y: number): SVGElement {
  if (kind === "clouds") return svg("rect", { x: x - 3.5, y: y - 3.5, width: 7, height: 7, class: "mark clouds" });
  if (kind === "photos") return svg("circle", { cx: x, cy: y, r: 4.5, class: "mark photos" });
  return svg("path", { d: `M${x - 5} ${y}H${x + 5}M${x} ${y - 5}V${y + 5}`, class: "mark both" });
}

function symbol(kind: string): Node {
  if (kind === "a" || kind === "b") return el("i", { class: `dot ${kind}` });
  return svg("svg", { viewBox: "0 0 14 14", width: 14, height: 14, "aria-hidden": "true", class: "key" }, mark(kind as "clouds" | "photos" | "both", 7, 7));
}

/** Reads tracked stones by their index, one at a time: a long wall has tens of thousands of shifts. */
export function readTracks(columns: Columns): (stone: number) => Tracked | undefined {
  const end = columns.integers("shiftsEnd"), edge = columns.numbers("edge");
  const photos = [columns.integers("photo1"), columns.integers("photo2")] as const;
  const clouds = readShifts(columns, "clouds"), together = readShifts(columns, "photos"), both = readShifts(columns, "both"), single = readShifts(columns, "");
  const later = columns.integers("later"), photo = columns.integers("photo"), weight = columns.numbers("weight");
  const rows = new Map(Array.from(columns.integers("stone"), (stone, i) => [stone, i]));
  let pictured = 0;
  const places = Array.from(edge, (e) => (Number.isNaN(e) ? -1 : pictured++));
  return (stone) => {
    const i = rows.get(stone);
    if (i === undefined) return undefined;
    const shifts: PhotoShift[] = [];
    for (let k = i === 0 ? 0 : end[i - 1]!; k < end[i]!; k++) {
      const shift = single(k);
      if (shift) shifts.push({ ...shift, later: later[k] === 1, photo: photo[k]!, weight: weight[k]! });
    }
    return { place: places[i]!, photos: [photos[0][i]!, photos[1][i]!], clouds: clouds(i), together: together(i), both: both(i), single: shifts };
  };
}

/** Shifts of columns that begin with a word, or of those without one. */
function readShifts(columns: Columns, stem: string): (i: number) => Shift | null {
  const name = (of: string) => (stem ? stem + of : of[0]!.toLowerCase() + of.slice(1));
  const [along, up, sdAlong, sdUp, correlation] = ["Along", "Up", "SdAlong", "SdUp", "Correlation"].map((of) => columns.numbers(name(of)));
  return (i) => {
    if (Number.isNaN(along![i]!)) return null;
    const [a, u] = [sdAlong![i]!, sdUp![i]!];
    return { at: [along![i]!, up![i]!], covariance: [a * a, correlation![i]! * a * u, u * u] };
  };
}
