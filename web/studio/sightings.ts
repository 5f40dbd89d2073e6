// A stone in every photo of every epoch that shows it, with its outline.

import { button, el, svg } from "../src/dom.ts";
import type { EpochShown, Sighting } from "./api.ts";
import { server } from "./client.ts";
import { tx } from "./texts.ts";

/** A button that shows them. */
export function sightingsOf(stone: number, epochs: readonly EpochShown[], fail: (message: string) => void): HTMLElement {
  const box = el("div", { class: "sightings" });
  const show = button(tx("everyPhoto"), "", async () => {
    show.disabled = true;
    try {
      const all = await Promise.all(epochs.map((_, n) => server.sightings(n, stone)));
      box.replaceChildren(el("p", { class: "note" }, tx("everyPhotoNote")), ...all.flatMap((seen, n) => ofEpoch(stone, n, epochs[n]!.name, seen)));
    } catch (error) {
      show.disabled = false;
      fail((error as Error).message);
    }
  });
  box.append(show);
  return box;
}

function ofEpoch(stone: number, number: number, epoch: string, seen: readonly Sighting[]): HTMLElement[] {
  if (seen.length === 0) return [el("p", { class: "note" }, tx("noSighting", { epoch }))];
  return seen.map(({ photo, outline, aspect }, k) => {
    const name = tx("sighting", { epoch, photo });
    const ring = outline.map(([x, y]) => `${x * aspect},${y}`).join(" ");
    const line = svg("svg", { viewBox: `0 0 ${aspect} 1`, "aria-hidden": "true" }, svg("polygon", { points: ring }));
    const picture = el("img", { src: `/api/v1/epochs/${number}/stones/${stone}/${k}`, alt: name, loading: "lazy" });
    return el("figure", {}, el("div", {}, picture, line), el("figcaption", { class: "note" }, name));
  });
}
