// The state that the views share. A view reads it, changes it through `set`, and is told when it changed.

import type { QuantityKey } from "./quantities.ts";

/** A line on the unrolled wall, metres: from (a1, u1) to (a2, u2). */
export interface Line {
  readonly a1: number;
  readonly u1: number;
  readonly a2: number;
  readonly u2: number;
}

export interface State {
  readonly quantity: QuantityKey;
  /** Fade what is below its detection limit. */
  readonly fade: boolean;
  readonly arrows: boolean;
  /** Whose photos lie behind the map: of no epoch, of the first or of the later one. */
  readonly behind: "none" | "first" | "later";
  /** Which picture is shown. */
  readonly view: "map" | "scene";
  /** What dragging on the map does. */
  readonly tool: "move" | "profile";
  /** Stone under the pointer and chosen stone, indices; -1 for none. */
  readonly hover: number;
  readonly chosen: number;
  /** The map should bring the chosen stone into view. */
  readonly follow: number;
  readonly profile: Line | null;
}

export type Listener = (state: State, before: State) => void;

export class Store {
  #state: State;
  readonly #listeners: Listener[] = [];

  constructor(state: State) {
    this.#state = state;
  }

  get(): State {
    return this.#state;
  }

  set(change: Partial<State>): void {
    const before = this.#state;
    const keys = Object.keys(change) as (keyof State)[];
    if (keys.every((key) => Object.is(before[key], change[key]))) return;
    this.#state = { ...before, ...change };
    for (const listener of this.#listeners) listener(this.#state, before);
  }

  /** Calls back at every later change. */
  on(listener: Listener): void {
    this.#listeners.push(listener);
  }

  /** Chooses a stone and brings it into view. */
  choose(stone: number): void {
    this.set({ chosen: stone, follow: this.#state.follow + (stone >= 0 ? 1 : 0) });
  }
}
