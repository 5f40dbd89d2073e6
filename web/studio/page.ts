// What a page of the studio is, and what several of them need.

import type { State } from "./api.ts";
import type { Live } from "./client.ts";

/** Fills a place with a page, until the signal ends it. */
export type Page = (place: HTMLElement, live: Live, until: AbortSignal) => void;

/** Whether a run that was started here works. */
export function isAtWork(state: State): boolean {
  return state.run.phase === "running" || state.run.phase === "stopping";
}
