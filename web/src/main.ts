// Starts the interactive part of the report. Without it the page is whole, only still.

import { readReport } from "./data.ts";
import { el } from "./dom.ts";
import { quantities } from "./quantities.ts";
import { Store } from "./store.ts";
import { legend } from "./views/legend.ts";
import { WallMap } from "./views/map.ts";
import { Photos } from "./views/photos.ts";
import { profile } from "./views/profile.ts";
import { Sections } from "./views/sections.ts";
import { StonePanel } from "./views/stone.ts";
import { toolbar } from "./views/toolbar.ts";
import "./style.css";

async function start(): Promise<void> {
  const place = document.getElementById("explore");
  const report = place ? await readReport(document) : null;
  if (!place || !report) return;
  const store = new Store({
    quantity: "out", fade: true, arrows: false, view: "map", tool: "move", hover: -1, chosen: -1, follow: 0, profile: null,
  });
  const shown = quantities(report);
  const map = new WallMap(report, store, shown);
  const panel = new StonePanel(report, store, new Photos(report), new Sections(report), (stone, upright) =>
    store.set({ profile: map.lineThrough(stone, upright) }));
  place.append(
    toolbar(report, store, shown, () => map),
    legend(report, store, shown),
    el("div", { class: "views" }, el("div", { class: "pictures" }, map.element), panel.element),
    profile(report, store),
  );
  place.hidden = false;
  for (const link of document.querySelectorAll<HTMLAnchorElement>("a[data-stone]")) {
    const stone = report.indexOfId.get(Number(link.dataset["stone"]));
    if (stone === undefined) continue;
    link.href = "#explore";
    link.addEventListener("click", () => store.choose(stone));
  }
  place.dataset["ready"] = "true";
}

void start();
