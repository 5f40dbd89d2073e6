// What the map and the 3D view can show of a stone.

import { type Report, isMeasured, norm } from "./data.ts";

export type QuantityKey =
  | "out" | "along" | "up" | "norm" | "limit" | "relative" | "rotation" | "opening" | "m3c2" | "difference"
  | "confidence" | "status";

export interface Quantity {
  readonly key: QuantityKey;
  readonly label: string;
  readonly unit: string;
  /** Colours: from minus to plus, from zero up, or one for each outcome. */
  readonly scale: "diverging" | "sequential" | "outcomes";
  /** End of the scale, in `unit`. */
  readonly limit: number;
  /** Start of a sequential scale, 0 unless given. */
  readonly start?: number;
  /** Whether stones below their detection limit may be faded. */
  readonly fades: boolean;
  /** Decimals that the unit is worth. */
  readonly decimals: number;
  /** Value of a stone in `unit`; NaN for none. */
  readonly value: (stone: number) => number;
  /** How to read it. */
  readonly note: string;
}

/** Colours of the outcomes: ok first, then failures, told apart by lightness too (after Okabe & Ito 2008). */
export const OUTCOME_COLOURS = [
  "#4a8db7", "#e6dcb8", "#e69f00", "#f0e442", "#cc79a7", "#8c8c8c", "#5b4a42", "#9c2f2f", "#0f7a5f",
] as const;

/** All quantities of a report, in the order of the menu. */
export function quantities(report: Report): readonly Quantity[] {
  const { stones, document: { limits } } = report;
  const measured = (i: number, value: number) => (isMeasured(stones, i) ? value : NaN);
  const component = (key: "along" | "up" | "out", axis: 0 | 1 | 2, label: string, note: string): Quantity => ({
    key, label, note, unit: "mm", scale: "diverging", limit: limits.component, fades: true, decimals: 1,
    value: (i) => stones.move[axis][i]! * 1e3,
  });
  const all: readonly Quantity[] = [
    component("out", 2, "Out of the wall", "Positive towards the viewer."),
    component("along", 0, "Along the wall", "Positive to the right of a viewer who faces the wall."),
    component("up", 1, "Up the face", "Positive upwards along the batter."),
    {
      key: "norm", label: "Length of the motion", unit: "mm", scale: "sequential", limit: limits.norm, fades: true,
      decimals: 1, value: (i) => norm(stones.move, i) * 1e3, note: "In three dimensions.",
    },
    {
      key: "limit", label: "Detection limit (LoD95)", unit: "mm", scale: "sequential", limit: limits.limit, fades: false,
      decimals: 2, value: (i) => stones.limit[i]! * 1e3, note: "What a motion must exceed to be above its 95 % limit.",
    },
    {
      key: "relative", label: "Against the neighbours", unit: "mm", scale: "sequential", limit: limits.relative, fades: false,
      decimals: 2, value: (i) => norm(stones.relative, i) * 1e3, note: "Length of the difference to what the neighbours predict.",
    },
    {
      key: "rotation", label: "Rotation", unit: "mrad", scale: "sequential", limit: limits.rotation, fades: false,
      decimals: 2, value: (i) => norm(stones.rotation, i) * 1e3, note: "Angle of the stone's turn.",
    },
    {
      key: "opening", label: "Joint opening", unit: "mm", scale: "diverging", limit: limits.opening, fades: true, decimals: 2,
      value: () => NaN, note: "Across each joint: red opens, blue closes. Pale: less than its 95 % uncertainty.",
    },
    {
      key: "m3c2", label: "M3C2 distance", unit: "mm", scale: "diverging", limit: limits.component, fades: true, decimals: 1,
      value: (i) => stones.m3c2[i]! * 1e3,
      note: "Between the clouds along their normals, for comparison; blind to motion within the face.",
    },
    {
      key: "difference", label: "Stone minus M3C2", unit: "mm", scale: "diverging", limit: limits.component, fades: false, decimals: 1,
      value: (i) => (stones.move[2][i]! - stones.m3c2[i]!) * 1e3, note: "Out of the wall: the stone's motion less the median M3C2 distance on it.",
    },
    {
      key: "confidence", label: "Confidence of the outline", unit: "%", scale: "sequential", start: 50, limit: 100, fades: false, decimals: 0,
      value: (i) => stones.confidence[i]! * 100, note: "Mean share of the photos' votes that the stone's points gave it.",
    },
    {
      key: "status", label: "Outcome", unit: "", scale: "outcomes", limit: 1, fades: false, decimals: 0,
      value: (i) => measured(i, 0), note: "What became of every stone.",
    },
  ];
  const hasChange = report.change.a.length > 0;
  return all.filter((q) => hasChange || (q.key !== "m3c2" && q.key !== "difference"));
}

/** Colours of values of a quantity. */
export class Palette {
  readonly #colours: readonly string[];
  readonly #quantity: Quantity;

  constructor(report: Report, quantity: Quantity) {
    const { diverging, sequential } = report.document.colours;
    this.#colours = quantity.scale === "diverging" ? diverging : sequential;
    this.#quantity = quantity;
  }

  /** All steps, from the low to the high end. */
  get colours(): readonly string[] {
    return this.#colours;
  }

  /** Colour of a value in the quantity's unit; values beyond the scale have its end's. */
  of(value: number): string {
    const { scale, limit, start = 0 } = this.#quantity;
    const along = scale === "diverging" ? (value / limit + 1) / 2 : (value - start) / (limit - start);
    const last = this.#colours.length - 1;
    return this.#colours[Math.round(Math.min(1, Math.max(0, along)) * last)]!;
  }
}

/** Colour of a stone; `null` where it has no value. */
export function stoneColour(report: Report, quantity: Quantity, palette: Palette, i: number): string | null {
  if (quantity.scale === "outcomes") return OUTCOME_COLOURS[report.stones.state[i]!] ?? null;
  const value = quantity.value(i);
  return Number.isNaN(value) ? null : palette.of(value);
}

/** Whether a stone is faded: its motion is below its detection limit. */
export function isFaded(report: Report, quantity: Quantity, fade: boolean, i: number): boolean {
  return fade && quantity.fades && !report.stones.significant[i];
}

/** Whether the opening of a joint differs from zero at 95 %; metres. */
export function opens(opening: number, sigma: number): boolean {
  return Math.abs(opening) > 1.96 * sigma;
}
