// Starts the interactive part of the report. Without it the page is whole, only still.

import { isMeasured, readReport } from "./data.ts";
import { el } from "./dom.ts";
import { quantities } from "./quantities.ts";
import { Store } from "./store.ts";
import { t } from "./texts.ts";
import { reachable } from "./reachable.ts";
import { enliven } from "./views/charts.ts";
import { legend } from "./views/legend.ts";
import { stoneList } from "./views/list.ts";
import { WallMap } from "./views/map.ts";
import { Photos } from "./views/photos.ts";
import { profile } from "./views/profile.ts";
import { WallScene } from "./views/scene.ts";
import { Sections } from "./views/sections.ts";
import { StonePanel, byMotion } from "./views/stone.ts";
import { Tracks } from "./views/tracks.ts";
import { toolbar } from "./views/toolbar.ts";
import "./style.css";

async function start(): Promise<void> {
  const place = document.getElementById("explore");
  const report = place ? await readReport(document) : null;
  if (!place || !report) return;
  // The stone of the largest motion is shown first.
  const largest = byMotion(report.stones)[0] ?? -1;
  const store = new Store({
    quantity: "out", fade: report.document.sound, arrows: false, behind: "none", view: "map", tool: "move", hover: -1,
    chosen: largest >= 0 && isMeasured(report.stones, largest) ? largest : -1, follow: 0, profile: null,
  });
  const shown = quantities(report);
  const photos = new Photos(report);
  const map = new WallMap(report, store, shown, photos);
  const pictures = el("div", { class: "pictures" }, map.element);
  let scene: WallScene | null = null;
  const showScene = () => {
    const inSpace = store.get().view === "scene";
    try {
      if (inSpace) scene ??= new WallScene(report, store, shown);
    } catch (error) {
      pictures.append(el("p", { class: "note no-scene" }, t("no3d", { error: String(error) })));
    }
    if (scene && !scene.element.isConnected) pictures.append(scene.element);
    if (scene) scene.element.hidden = !inSpace;
    map.element.hidden = inSpace;
  };
  store.on((state, before) => {
    if (state.view !== before.view) showScene();
  });
  const panel = new StonePanel(report, store, { photos, tracks: new Tracks(report), sections: new Sections(report) }, (stone, upright) =>
    store.set({ profile: map.lineThrough(stone, upright) }));
  place.append(
    toolbar(report, store, shown, () => (store.get().view === "scene" && scene ? scene : map)),
    legend(report, store, shown),
    el("div", { class: "views" }, pictures, panel.element),
    panel.announcer,
    profile(report, store),
    stoneList(report, store),
  );
  enliven(report, store);
  reachable(document.querySelectorAll<HTMLElement>("main > section .scroll, header .scroll"));
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
