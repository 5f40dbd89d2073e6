// What stands still on the face - photos and outlines - painted once, in tiles: moving it copies pixels.

import { el } from "../src/dom.ts";

/** Edge of a tile, pixels. */
const SIDE = 256;
/** Tiles that are kept of a scale, most: 64 MB. */
const MOST = 256;
/** A scale that has not changed for so long gets tiles of its own, milliseconds. */
const SETTLED_MS = 120;
/** Time for new tiles in a frame, milliseconds. */
const BUDGET_MS = 4;

/** Left, low, right, high, metres on the unrolled wall. */
export type Box = readonly [number, number, number, number];

/** Where the wall's zero lies, and how large a metre is; pixels of the canvas. */
export interface View {
  readonly scale: number;
  readonly x: number;
  readonly y: number;
}

interface Tile {
  readonly canvas: HTMLCanvasElement;
  /** The version of what it shows. */
  version: number;
}

/** The tiles of a scale. Tile [i, k] begins i sides right of the wall's zero and k sides below it. */
interface Layer {
  readonly scale: number;
  readonly tiles: Map<string, Tile>;
}

export class Tiles {
  /** Paints what lies in a box, with a pen whose unit is a metre and whose ordinate points up. */
  readonly #paint: (pen: CanvasRenderingContext2D, box: Box) => void;
  /** Asks for another frame. */
  readonly #again: () => void;
  /** Tiles of the scale at which the wall was shown first: the whole wall, under what is not painted yet. */
  #whole: Layer | null = null;
  /** Tiles of the last scales at which the view rested, the newest last. */
  #rested: Layer[] = [];
  #version = 0;
  #scale = 0;
  #since = 0;
  #timer = 0;

  constructor(paint: (pen: CanvasRenderingContext2D, box: Box) => void, again: () => void) {
    this.#paint = paint;
    this.#again = again;
  }

  /** What was painted is not right any more. It is shown until it is painted anew. */
  forget(): void {
    this.#version++;
    this.#again();
  }

  /** Draws what there is; whether all of it is painted as it should be. */
  draw(pen: CanvasRenderingContext2D, view: View, width: number, height: number): boolean {
    const now = performance.now();
    if (view.scale !== this.#scale) [this.#scale, this.#since] = [view.scale, now];
    const layer = this.#layer(now);
    const isSharp = layer.scale === view.scale;
    // Of a scale that is much finer than the view's, there are never enough.
    const places = layer.scale < 2 * view.scale ? placesIn(layer.scale, view, width, height) : [];
    if (isSharp) this.#paintMissing(layer, places, now);
    const isWhole = places.length > 0 && places.every((place) => layer.tiles.has(String(place)));
    const below = isWhole ? [] : [this.#whole, ...this.#rested].filter((other) => other !== null && other !== layer);
    for (const one of [...below, layer]) put(pen, one!, view, width, height);
    const isDone = isSharp && places.every((place) => layer.tiles.get(String(place))?.version === this.#version);
    if (isSharp && !isDone) this.#again();
    return isDone;
  }

  /** The layer to show: that of the view's scale once it rests, until then the last one. */
  #layer(now: number): Layer {
    const known = [this.#whole, ...this.#rested].find((layer) => layer?.scale === this.#scale);
    if (known) return known;
    const last = this.#rested.at(-1) ?? this.#whole;
    if (last && now - this.#since < SETTLED_MS) {
      window.clearTimeout(this.#timer);
      this.#timer = window.setTimeout(this.#again, SETTLED_MS);
      return last;
    }
    const layer = { scale: this.#scale, tiles: new Map<string, Tile>() };
    if (!this.#whole) this.#whole = layer;
    // The one before stays below until the new one is whole.
    else this.#rested = [...this.#rested.slice(-1), layer];
    return layer;
  }

  /** Paints tiles from the middle of the view outwards, at least one, as long as there is time. */
  #paintMissing(layer: Layer, places: readonly Place[], began: number): void {
    for (const place of places) {
      const key = String(place), old = layer.tiles.get(key);
      if (old?.version === this.#version) continue;
      const canvas = old?.canvas ?? el("canvas", { width: SIDE, height: SIDE });
      const pen = canvas.getContext("2d", { alpha: false })!;
      const [i, k] = place, { scale } = layer;
      pen.setTransform(scale, 0, 0, -scale, -i * SIDE, -k * SIDE);
      this.#paint(pen, [(i * SIDE) / scale, (-(k + 1) * SIDE) / scale, ((i + 1) * SIDE) / scale, (-k * SIDE) / scale]);
      layer.tiles.delete(key);
      layer.tiles.set(key, { canvas, version: this.#version });
      if (performance.now() - began > BUDGET_MS) break;
    }
    // Those that were painted first, and are not in sight, go first.
    const shown = new Set(places.map(String));
    for (const key of layer.tiles.keys()) {
      if (layer.tiles.size <= MOST) break;
      if (!shown.has(key)) layer.tiles.delete(key);
    }
  }
}

type Place = readonly [number, number];

/** The tiles that a view shows, from its middle outwards. */
function placesIn(scale: number, view: View, width: number, height: number): Place[] {
  const by = scale / view.scale, places: Place[] = [];
  const [left, top] = [(-view.x * by) / SIDE, (-view.y * by) / SIDE];
  const [right, low] = [((width - view.x) * by) / SIDE, ((height - view.y) * by) / SIDE];
  for (let i = Math.floor(left); i < right; i++) for (let k = Math.floor(top); k < low; k++) places.push([i, k]);
  const far = ([i, k]: Place) => Math.hypot(i + 0.5 - (left + right) / 2, k + 0.5 - (top + low) / 2);
  return places.sort((p, q) => far(p) - far(q));
}

/** Draws the tiles of a layer, larger or smaller where the view has another scale; edges lie between pixels. */
function put(pen: CanvasRenderingContext2D, { scale, tiles }: Layer, view: View, width: number, height: number): void {
  const edge = (SIDE * view.scale) / scale;
  pen.imageSmoothingQuality = "low";
  for (const [key, { canvas }] of tiles) {
    const [i, k] = key.split(",").map(Number) as [number, number];
    const [left, right] = [Math.round(view.x + i * edge), Math.round(view.x + (i + 1) * edge)];
    const [top, low] = [Math.round(view.y + k * edge), Math.round(view.y + (k + 1) * edge)];
    if (right > 0 && low > 0 && left < width && top < height) pen.drawImage(canvas, left, top, right - left, low - top);
  }
}
