// What the map and the 3D view can show of a stone.

import { type Report, isMeasured, norm } from "./data.ts";
import { t } from "./texts.ts";

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
  const { stones, document: { limits, sound } } = report;
  const measured = (i: number, value: number) => (isMeasured(stones, i) ? value : NaN);
  const component = (key: "along" | "up" | "out", axis: 0 | 1 | 2, label: string, note: string): Quantity => ({
    key, label, note, unit: "mm", scale: "diverging", limit: limits.component, fades: true, decimals: 1,
    value: (i) => stones.move[axis][i]! * 1e3,
  });
  const all: readonly Quantity[] = [
    component("out", 2, t("quantityOut"), t("quantityOutNote")),
    component("along", 0, t("quantityAlong"), t("quantityAlongNote")),
    component("up", 1, t("quantityUp"), t("quantityUpNote")),
    {
      key: "norm", label: t("quantityNorm"), unit: "mm", scale: "sequential", limit: limits.norm, fades: true,
      decimals: 1, value: (i) => norm(stones.move, i) * 1e3, note: t("quantityNormNote"),
    },
    {
      key: "limit", label: t("quantityLimit"), unit: "mm", scale: "sequential", limit: limits.limit, fades: false,
      decimals: 2, value: (i) => stones.limit[i]! * 1e3, note: t("quantityLimitNote"),
    },
    {
      key: "relative", label: t("quantityRelative"), unit: "mm", scale: "sequential", limit: limits.relative, fades: false,
      decimals: 2, value: (i) => norm(stones.relative, i) * 1e3, note: t("quantityRelativeNote"),
    },
    {
      key: "rotation", label: t("quantityRotation"), unit: "mrad", scale: "sequential", limit: limits.rotation, fades: false,
      decimals: 2, value: (i) => norm(stones.rotation, i) * 1e3, note: t("quantityRotationNote"),
    },
    {
      key: "opening", label: t("quantityOpening"), unit: "mm", scale: "diverging", limit: limits.opening, fades: true, decimals: 2,
      value: () => NaN, note: t("quantityOpeningNote") + (sound ? t("quantityOpeningPale") : ""),
    },
    {
      key: "m3c2", label: t("quantityM3c2"), unit: "mm", scale: "diverging", limit: limits.component, fades: true, decimals: 1,
      value: (i) => stones.m3c2[i]! * 1e3,
      note: t("quantityM3c2Note"),
    },
    {
      key: "difference", label: t("quantityDifference"), unit: "mm", scale: "diverging", limit: limits.component, fades: false, decimals: 1,
      value: (i) => (stones.move[2][i]! - stones.m3c2[i]!) * 1e3, note: t("quantityDifferenceNote"),
    },
    {
      key: "confidence", label: t("quantityConfidence"), unit: "%", scale: "sequential", start: 50, limit: 100, fades: false, decimals: 0,
      value: (i) => stones.confidence[i]! * 100, note: t("quantityConfidenceNote"),
    },
    {
      key: "status", label: t("quantityStatus"), unit: "", scale: "outcomes", limit: 1, fades: false, decimals: 0,
      value: (i) => measured(i, 0), note: t("quantityStatusNote"),
    },
  ];
  const hasChange = report.change.a.length > 0;
  return all.filter((q) => (hasChange || (q.key !== "m3c2" && q.key !== "difference")) && (sound || q.key !== "limit"));
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
