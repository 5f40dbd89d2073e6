// A list of stones that come, go or get another border; a press on one brings it into view.

import { button, el } from "../src/dom.ts";
import type { StoneChange } from "./api.ts";
import { tx } from "./texts.ts";

/** How many of each kind. */
export function countChanges(changes: readonly StoneChange[]): Record<StoneChange["fate"], number> {
  const counts = { new: 0, gone: 0, changed: 0 };
  for (const { fate } of changes) counts[fate]++;
  return counts;
}

/** The list; `name` is read to those who do not see it. */
export function changeList(changes: readonly StoneChange[], name: string, look: (change: StoneChange) => void): HTMLElement {
  const rows = changes.map((change) => {
    const what = change.stones.length > 0 ? `${tx(`fate_${change.fate}`)}: ${change.stones.join(", ")}` : tx(`fate_${change.fate}`);
    return el("li", {}, button(what, "", () => look(change)));
  });
  return el("ol", { class: "queue", tabindex: 0, "aria-label": name }, ...rows);
}
