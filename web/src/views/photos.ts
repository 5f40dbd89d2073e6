// Photo crops of a stone in both epochs, with the outline of its mask.

import type { Report } from "../data.ts";

/** Crops of the report. */
export class Photos {
  constructor(readonly report: Report) {}

  /** The card of a stone; `null` where the report has no crops. */
  of(_stone: number): Node | null {
    return null;
  }
}
