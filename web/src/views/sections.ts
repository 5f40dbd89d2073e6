// The points of a stone in both epochs, cut along and up.

import type { Report } from "../data.ts";

/** Sections of the report. */
export class Sections {
  constructor(readonly report: Report) {}

  /** The card of a stone; `null` where the report has no sections. */
  of(_stone: number): Node | null {
    return null;
  }
}
