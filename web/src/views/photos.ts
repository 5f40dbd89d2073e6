// Photo crops of a stone in both epochs, rectified to its face, with the outline of its mask.

import type { Columns } from "../blocks.ts";
import type { CropDocument, Report } from "../data.ts";
import { el, embedded } from "../dom.ts";
import { fixed } from "../format.ts";
import { t } from "../texts.ts";

/** Shortest time between the pictures of a blink, milliseconds. */
const BLINK_MS = 700;

/** One epoch's crops. */
interface Epoch {
  readonly document: CropDocument;
  /** Place of a stone's crop, by the stone's index. */
  readonly places: ReadonlyMap<number, number>;
  readonly columns: Columns;
  readonly half: Float64Array;
  readonly ring: Float64Array;
  readonly pictures: Promise<HTMLImageElement>[];
}

/** All crops of an epoch with their pictures. */
export interface PlacedCrops {
  /** Place of a stone's crop, by the stone's index. */
  readonly places: ReadonlyMap<number, number>;
  /** Half the edge of the crop at each place, metres. */
  readonly half: ArrayLike<number>;
  /** Edge of a crop, pixels, and crops in a row of a picture. */
  readonly side: number;
  readonly perRow: number;
  readonly pictures: readonly HTMLImageElement[];
}

/** Crops of the report. */
export class Photos {
  readonly #report: Report;
  readonly #epochs: [Promise<Epoch | null>, Promise<Epoch | null>] | null;
  #blinking = 0;

  constructor(report: Report) {
    this.#report = report;
    this.#epochs = report.document.crops.some((c) => c !== null) ? [this.#open(0), this.#open(1)] : null;
  }

  /** The card of a stone; `null` where the report has no crops. */
  of(stone: number): Node | null {
    window.clearInterval(this.#blinking);
    if (!this.#epochs) return null;
    const canvases = [this.#canvas(0), this.#canvas(1)] as const;
    const captions = [el("figcaption", { class: "note" }), el("figcaption", { class: "note" })] as const;
    const outline = el("input", { type: "checkbox", checked: true });
    const blink = el("input", { type: "checkbox" });
    const draw = (swapped = false) =>
      void Promise.all(([0, 1] as const).map((epoch) => this.#draw(stone, epoch, canvases[swapped && epoch === 0 ? 1 - epoch : epoch], captions[epoch], outline.checked)));
    outline.addEventListener("change", () => draw());
    blink.addEventListener("change", () => {
      window.clearInterval(this.#blinking);
      void this.#blink(stone, blink.checked, canvases[0], captions, outline);
    });
    draw();
    return el("div", { class: "card photos" }, el("h4", {}, t("photoTitle")),
      el("div", { class: "pair" }, ...([0, 1] as const).map((k) => el("figure", {}, canvases[k], captions[k]))),
      el("p", { class: "choices" }, el("label", {}, outline, t("outlineOfMask")), el("label", {}, blink, t("blink"))));
  }

  /** All crops of an epoch, with their pictures; `null` where the report has none. */
  async placed(epoch: 0 | 1): Promise<PlacedCrops | null> {
    const crops = await this.#epochs?.[epoch];
    if (!crops) return null;
    const { side, perRow, atlases } = crops.document;
    const pictures = await Promise.all(Array.from({ length: atlases }, (_, number) => this.#picture(crops, epoch, number)));
    // A crop of no stone of this page has no place on the wall.
    const known = [...crops.places].filter(([stone]) => stone < this.#report.stones.count);
    return { places: new Map(known), half: crops.half, side, perRow, pictures };
  }

  #canvas(epoch: 0 | 1): HTMLCanvasElement {
    const name = t("photoCrop", { epoch: this.#report.document.epochs[epoch] });
    return el("canvas", { width: 340, height: 340, role: "img", "aria-label": name });
  }

  /** Shows both epochs in turns in the first place. */
  async #blink(stone: number, on: boolean, canvas: HTMLCanvasElement, captions: readonly [HTMLElement, HTMLElement], outline: HTMLInputElement): Promise<void> {
    await this.#draw(stone, 0, canvas, captions[0], outline.checked);
    if (!on) return;
    let epoch: 0 | 1 = 0;
    this.#blinking = window.setInterval(() => {
      epoch = epoch === 0 ? 1 : 0;
      void this.#draw(stone, epoch, canvas, captions[0], outline.checked);
      if (!canvas.isConnected) window.clearInterval(this.#blinking);
    }, BLINK_MS);
  }

  async #open(epoch: 0 | 1): Promise<Epoch | null> {
    const document = this.#report.document.crops[epoch];
    const columns = await this.#report.block(`crops${epoch + 1}`);
    if (!document || !columns) return null;
    const stones = columns.integers("stone");
    return {
      document,
      places: new Map(Array.from(stones, (stone, place) => [stone, place])),
      columns,
      half: columns.numbers("half"),
      ring: columns.numbers("ring"),
      pictures: [],
    };
  }

  async #draw(stone: number, epoch: 0 | 1, canvas: HTMLCanvasElement, caption: HTMLElement, outlined: boolean): Promise<void> {
    const pen = canvas.getContext("2d")!;
    const crops = await this.#epochs![epoch];
    const place = crops?.places.get(stone);
    const name = this.#report.document.epochs[epoch];
    if (!crops || place === undefined) {
      pen.clearRect(0, 0, canvas.width, canvas.height);
      caption.textContent = t("noPhoto", { epoch: name });
      return;
    }
    const { side, perRow, photos } = crops.document;
    const picture = await this.#picture(crops, epoch, Math.floor(place / (perRow * perRow)));
    const slot = place % (perRow * perRow), size = canvas.width;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.imageSmoothingQuality = "high";
    pen.drawImage(picture, (slot % perRow) * side, Math.floor(slot / perRow) * side, side, side, 0, 0, size, size);
    if (outlined) this.#outline(pen, crops, place, size / side);
    scaleBar(pen, size, crops.half[place]!);
    caption.textContent = `${name}: ${photos[crops.columns.integers("photo")[place]!] ?? ""}`;
    canvas.dataset["drawn"] = String(stone);
  }

  #outline(pen: CanvasRenderingContext2D, crops: Epoch, place: number, scale: number): void {
    const ringsEnd = crops.columns.integers("ringsEnd"), ringEnd = crops.columns.integers("ringEnd");
    pen.beginPath();
    for (let r = place === 0 ? 0 : ringsEnd[place - 1]!; r < ringsEnd[place]!; r++) {
      // Curves through the middles of the edges: the outline of a mask has steps of a pixel, which mean nothing.
      const from = r === 0 ? 0 : ringEnd[r - 1]!, n = ringEnd[r]! - from;
      const vertex = (k: number): [number, number] => [crops.ring[2 * (from + (k % n))]! * scale, crops.ring[2 * (from + (k % n)) + 1]! * scale];
      const middle = (k: number): [number, number] => {
        const [x0, y0] = vertex(k), [x1, y1] = vertex(k + 1);
        return [(x0 + x1) / 2, (y0 + y1) / 2];
      };
      pen.moveTo(...middle(0));
      for (let k = 1; k <= n; k++) pen.quadraticCurveTo(...vertex(k), ...middle(k));
      pen.closePath();
    }
    pen.lineJoin = "round";
    pen.strokeStyle = "#000a";
    pen.lineWidth = 5;
    pen.stroke();
    pen.strokeStyle = "#ffe25a";
    pen.lineWidth = 2.2;
    pen.stroke();
  }

  /** A picture of crops, decoded once. */
  #picture(crops: Epoch, epoch: 0 | 1, number: number): Promise<HTMLImageElement> {
    return (crops.pictures[number] ??= embedded(`crops-${epoch + 1}-${number}`));
  }
}

/** A bar of a round length in the lower left corner. `half`: metres from the middle to the edge. */
function scaleBar(pen: CanvasRenderingContext2D, size: number, half: number): void {
  const metres = [0.5, 0.2, 0.1, 0.05, 0.02].find((m) => m < 0.8 * half) ?? 0.01;
  const length = (metres / (2 * half)) * size;
  pen.fillStyle = "#000c";
  pen.fillRect(10, size - 34, length + 12, 26);
  pen.fillStyle = "#fff";
  pen.fillRect(16, size - 15, length, 3);
  pen.font = "15px system-ui, sans-serif";
  pen.fillText(`${fixed(metres * 100, 0)} cm`, 16, size - 19);
}
