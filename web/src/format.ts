// Numbers as text: true minus signs, the language's decimal mark, a dash where there is no value.

import { DECIMAL } from "./texts.ts";

export const DASH = "\u2013";

/** A number with this many decimals. */
export function fixed(value: number, decimals: number): string {
  if (!Number.isFinite(value)) return DASH;
  const text = Math.abs(value).toFixed(decimals), sign = value < 0 && Number(text) !== 0 ? "\u2212" : "";
  return sign + text.replace(".", DECIMAL);
}

/** Metres as millimetres with one decimal, from 100 mm on without, below 1 mm with two. */
export function mm(metres: number): string {
  const value = metres * 1e3;
  const size = Math.abs(value);
  return fixed(value, size >= 99.95 ? 0 : size >= 0.995 || size === 0 ? 1 : 2);
}

/** A length with its sign, decimals as in `mm`. */
export function signedMm(metres: number): string {
  const text = mm(metres);
  return metres > 0 && /[1-9]/.test(text) ? `+${text}` : text;
}

/** A share as a percentage. */
export function percent(share: number): string {
  return Number.isFinite(share) ? `${fixed(share * 100, 0)}\u00a0%` : DASH;
}

/** A whole number with thin spaces between thousands. */
export function count(value: number): string {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/** The smallest of 1, 2, 2.5, 5 times a power of ten that is at least this value. */
export function niceAbove(value: number): number {
  if (!Number.isFinite(value) || value <= 0) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return ([1, 2, 2.5, 5, 10].find((s) => s * power >= value * (1 - 1e-9)) ?? 10) * power;
}

/** Round values within a range, about `wanted` of them. */
export function ticks(low: number, high: number, wanted: number): number[] {
  const step = niceAbove((high - low) / Math.max(1, wanted));
  if (!(high > low)) return [];
  const out: number[] = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= high / step + 1e-9; i++) out.push(i * step + 0);
  return out;
}

/** Decimals that the steps between ticks need. */
export function decimalsOf(values: readonly number[]): number {
  const step = values.length > 1 ? Math.abs(values[1]! - values[0]!) : Math.abs(values[0] ?? 1);
  let decimals = 0;
  while (decimals < 6 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6) decimals++;
  return decimals;
}
