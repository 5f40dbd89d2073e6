// The wall's own photos behind the map: the crops of all stones, put together on the unrolled wall as an orthophoto of the face.

import type { Report } from "../data.ts";
import { el } from "../dom.ts";
import type { PlacedCrops, Photos } from "./photos.ts";

/** Pixels of a sheet at most: what every browser draws, and 48 MB. */
const SHEET_PX = 12e6;

/** The photos of one epoch, side by side. */
interface Sheet {
  readonly canvas: HTMLCanvasElement;
  /** Left, low, right, high, metres on the unrolled wall. */
  readonly box: readonly [number, number, number, number];
}

/** Sheets are made when they are first shown. */
export class Backdrop {
  readonly #report: Report;
  readonly #photos: Photos;
  readonly #paths: readonly Path2D[];
  readonly #ready: () => void;
  readonly #sheets: [Sheet | null | undefined, Sheet | null | undefined] = [undefined, undefined];

  /** `paths`: the outlines of the stones, metres on the unrolled wall; `ready`: called when a sheet can be drawn. */
  constructor(report: Report, photos: Photos, paths: readonly Path2D[], ready: () => void) {
    this.#report = report;
    this.#photos = photos;
    this.#paths = paths;
    this.#ready = ready;
  }

  /** Draws the photos of an epoch with a pen whose unit is a metre and whose ordinate points up; false while they are not there. */
  draw(pen: CanvasRenderingContext2D, epoch: 0 | 1): boolean {
    const sheet = this.#sheets[epoch];
    if (sheet === undefined) {
      this.#sheets[epoch] = null;
      void this.#make(epoch);
    }
    if (!sheet) return false;
    const [left, low, right, high] = sheet.box;
    pen.save();
    pen.scale(1, -1);
    pen.imageSmoothingQuality = "high";
    pen.drawImage(sheet.canvas, left, -high, right - left, high - low);
    pen.restore();
    return true;
  }

  async #make(epoch: 0 | 1): Promise<void> {
    const crops = await this.#photos.placed(epoch);
    if (!crops) return;
    const { a, u } = this.#report.stones;
    const box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const [stone, place] of crops.places) {
      const half = crops.half[place]!;
      box[0] = Math.min(box[0], a[stone]! - half);
      box[1] = Math.min(box[1], u[stone]! - half);
      box[2] = Math.max(box[2], a[stone]! + half);
      box[3] = Math.max(box[3], u[stone]! + half);
    }
    const [w, h] = [box[2] - box[0], box[3] - box[1]];
    if (!(w > 0 && h > 0)) return;
    const scale = Math.min(finest(crops), Math.sqrt(SHEET_PX / (w * h)));
    const canvas = el("canvas", { width: Math.max(1, Math.round(w * scale)), height: Math.max(1, Math.round(h * scale)) });
    const pen = canvas.getContext("2d");
    if (!pen) return;
    pen.imageSmoothingQuality = "high";
    this.#paint(pen, crops, scale, box);
    this.#sheets[epoch] = { canvas, box };
    this.#ready();
  }

  /** Each crop shows the stone's surroundings, too: these fill the joints, and every stone comes from its own crop. */
  #paint(pen: CanvasRenderingContext2D, crops: PlacedCrops, scale: number, box: Sheet["box"]): void {
    const { a, u } = this.#report.stones;
    const put = (stone: number, place: number) => {
      const half = crops.half[place]!, { side, perRow } = crops, slot = place % (perRow * perRow);
      const picture = crops.pictures[Math.floor(place / (perRow * perRow))];
      if (!picture) return;
      const [x, y] = [(slot % perRow) * side, Math.floor(slot / perRow) * side];
      pen.setTransform(scale, 0, 0, scale, -box[0] * scale, box[3] * scale);
      pen.drawImage(picture, x, y, side, side, a[stone]! - half, -u[stone]! - half, 2 * half, 2 * half);
    };
    // Small stones over large ones, whose crops reach far.
    const all = [...crops.places].sort((p, q) => crops.half[q[1]]! - crops.half[p[1]]!);
    for (const [stone, place] of all) put(stone, place);
    for (const [stone, place] of all) {
      pen.save();
      pen.setTransform(scale, 0, 0, -scale, -box[0] * scale, box[3] * scale);
      pen.clip(this.#paths[stone]!);
      put(stone, place);
      pen.restore();
    }
  }
}

/** Pixels in a metre of the finest crop. */
function finest(crops: PlacedCrops): number {
  let least = Infinity;
  for (const place of crops.places.values()) least = Math.min(least, crops.half[place]!);
  return crops.side / (2 * least);
}
