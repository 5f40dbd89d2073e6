// The unrolled wall on a canvas: zoom, hover, choose, layers, arrows, the line of a profile.

import { type Report, ringOf } from "../data.ts";
import { css, el } from "../dom.ts";
import { fixed } from "../format.ts";
import { Squares, contains } from "../geometry.ts";
import { Palette, type Quantity, isFaded, opens, stoneColour } from "../quantities.ts";
import type { Line, Store } from "../store.ts";
import { t } from "../texts.ts";
import { Backdrop } from "./backdrop.ts";
import type { Photos } from "./photos.ts";
import { stoneFacts } from "./stone.ts";

/** Length of the longest arrow, least distance between arrows, pixels. */
const ARROW_PX = 46;
const ARROW_SPACING_PX = 16;
/** Opacity of what is below its detection limit. */
const FADED = 0.28;
/** Opacity of stones before photos: the stone shows through its colour. */
const BEFORE_PHOTOS = 0.5;
/** Outline of loose stones. */
const LIGHT = "#ffffff";
const DARK = "#14181c";
/** Half the edge of an M3C2 square, metres. */
const CHANGE_HALF_M = 0.026;

/** Metres of the wall to pixels of the canvas: px = x + scale * a, py = y - scale * u. */
interface View {
  scale: number;
  x: number;
  y: number;
}

/** The map. */
export class WallMap {
  readonly element: HTMLElement;
  readonly #canvas: HTMLCanvasElement;
  readonly #pen: CanvasRenderingContext2D;
  readonly #tip: HTMLElement;
  readonly #report: Report;
  readonly #store: Store;
  readonly #quantities: ReadonlyMap<string, Quantity>;
  readonly #paths: Path2D[] = [];
  readonly #rings: Float64Array[] = [];
  /** Left, low, right, high of every stone, metres. */
  readonly #boxes: Float64Array;
  readonly #squares = new Squares(1);
  readonly #backdrop: Backdrop;
  readonly #wall: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
  #view: View = { scale: 1, x: 0, y: 0 };
  #width = 0;
  #height = 0;
  #waiting = false;
  #drag: { x: number; y: number; moved: boolean; line: boolean } | null = null;

  constructor(report: Report, store: Store, quantities: readonly Quantity[], photos: Photos) {
    this.#report = report;
    this.#store = store;
    this.#quantities = new Map(quantities.map((q) => [q.key, q]));
    this.#canvas = el("canvas", {
      tabindex: 0,
      role: "application",
      "aria-label": t("mapName"),
    });
    this.#pen = this.#canvas.getContext("2d")!;
    this.#tip = el("div", { class: "tip", hidden: true });
    this.element = el("div", { class: "wall-map" }, this.#canvas, this.#tip);
    this.#boxes = new Float64Array(4 * report.stones.count);
    for (let i = 0; i < report.stones.count; i++) this.#build(i);
    this.#backdrop = new Backdrop(report, photos, this.#paths, () => this.redraw());
    this.#listen();
    store.on((state, before) => {
      if (state.follow !== before.follow) this.#show(state.chosen);
      this.redraw();
    });
    new ResizeObserver(() => this.#resize()).observe(this.element);
  }

  /** Draws at the next frame. */
  redraw(): void {
    if (this.#waiting) return;
    this.#waiting = true;
    requestAnimationFrame(() => {
      this.#waiting = false;
      this.#draw();
    });
  }

  /** Zooms about the middle. */
  zoom(by: number): void {
    this.#zoomAt(by, this.#width / 2, this.#height / 2);
  }

  /** Shows the whole wall. */
  whole(): void {
    const [left, low, right, high] = this.#wall;
    const w = right - left || 1, h = high - low || 1;
    const scale = Math.min((this.#width - 32) / w, (this.#height - 64) / h);
    this.#view = {
      scale,
      x: (this.#width - w * scale) / 2 - left * scale,
      y: (this.#height - 24 + h * scale) / 2 + low * scale,
    };
    this.redraw();
  }

  /** A line across the whole wall through a stone, level or upright. */
  lineThrough(stone: number, upright: boolean): Line {
    const { stones } = this.#report;
    const [left, low, right, high] = this.#wall;
    const a = stones.a[stone]!, u = stones.u[stone]!;
    return upright ? { a1: a, u1: low - 0.05, a2: a, u2: high + 0.05 } : { a1: left - 0.05, u1: u, a2: right + 0.05, u2: u };
  }

  #build(i: number): void {
    const ring = ringOf(this.#report.stones, i);
    const path = new Path2D();
    const box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let k = 0; k < ring.length; k += 2) {
      const [a, u] = [ring[k]!, ring[k + 1]!];
      if (k) path.lineTo(a, u);
      else path.moveTo(a, u);
      box[0] = Math.min(box[0], a);
      box[1] = Math.min(box[1], u);
      box[2] = Math.max(box[2], a);
      box[3] = Math.max(box[3], u);
    }
    path.closePath();
    this.#paths.push(path);
    this.#rings.push(ring);
    this.#boxes.set(box, 4 * i);
    if (ring.length === 0) return;
    this.#squares.add(i, ...box);
    this.#wall[0] = Math.min(this.#wall[0], box[0]);
    this.#wall[1] = Math.min(this.#wall[1], box[1]);
    this.#wall[2] = Math.max(this.#wall[2], box[2]);
    this.#wall[3] = Math.max(this.#wall[3], box[3]);
  }

  #resize(): void {
    const first = this.#width === 0;
    const width = this.element.clientWidth;
    if (width === 0 || width === this.#width) return;
    this.#width = width;
    this.#height = this.element.clientHeight;
    const ratio = window.devicePixelRatio || 1;
    this.#canvas.width = Math.round(width * ratio);
    this.#canvas.height = Math.round(this.#height * ratio);
    this.whole();
    // Before the next frame: a resized canvas is empty.
    this.#draw();
    // The stone that is chosen from the start leaves the whole wall in view.
    if (first && this.#store.get().follow > 0) this.#show(this.#store.get().chosen);
  }

  #toWall(px: number, py: number): [number, number] {
    return [(px - this.#view.x) / this.#view.scale, (this.#view.y - py) / this.#view.scale];
  }

  #at(px: number, py: number): number {
    const [a, u] = this.#toWall(px, py);
    return this.#squares.at(a, u).find((i) => contains(this.#rings[i]!, a, u)) ?? -1;
  }

  #zoomAt(by: number, px: number, py: number): void {
    const scale = Math.max(0.5, Math.min(4000, this.#view.scale * by));
    const factor = scale / this.#view.scale;
    this.#view = { scale, x: px - (px - this.#view.x) * factor, y: py - (py - this.#view.y) * factor };
    this.redraw();
  }

  /** Brings a stone into view: zooms in where stones are tiny, moves only where it lies outside or near the edge. */
  #show(stone: number): void {
    if (stone < 0 || this.#width === 0) return;
    const { a, u } = this.#report.stones;
    const scale = Math.max(this.#view.scale, Math.min(this.#width, this.#height) / 6);
    if (scale > this.#view.scale) this.#zoomAt(scale / this.#view.scale, this.#width / 2, this.#height / 2);
    const x = this.#view.x + a[stone]! * scale, y = this.#view.y - u[stone]! * scale;
    const keep = (value: number, length: number) => Math.min(0.85 * length, Math.max(0.15 * length, value));
    this.#view = { scale, x: this.#view.x + keep(x, this.#width) - x, y: this.#view.y + keep(y, this.#height) - y };
    this.redraw();
  }

  #draw(): void {
    if (this.#width === 0) return;
    const pen = this.#pen, state = this.#store.get();
    const quantity = this.#quantities.get(state.quantity)!;
    const palette = new Palette(this.#report, quantity);
    const ink = css("--ink");
    this.#toScreen();
    pen.globalAlpha = 1;
    pen.fillStyle = css("--ground");
    pen.fillRect(0, 0, this.#width, this.#height);
    this.#toMetres();
    const behind = state.behind !== "none" && this.#backdrop.draw(pen, state.behind === "first" ? 0 : 1);
    const opacity = behind ? BEFORE_PHOTOS : 1;
    if (quantity.key === "m3c2") this.#drawChange(palette, state.fade, opacity);
    else this.#drawStones(quantity, palette, state.fade, opacity);
    if (quantity.key === "opening") this.#drawJoints(palette, state.fade);
    pen.globalAlpha = 1;
    this.#drawOutlines(ink, quantity.key === "m3c2");
    if (state.hover >= 0) this.#outline(state.hover, ink, 1.6);
    if (state.chosen >= 0) {
      this.#outline(state.chosen, css("--panel"), 6);
      this.#outline(state.chosen, css("--accent"), 3.2);
    }
    this.#toScreen();
    if (state.arrows) this.#drawArrows(ink);
    if (state.profile) this.#drawLine(state.profile, ink);
    this.#drawScaleBar(ink);
    this.#canvas.dataset["drawn"] = `${state.quantity} ${state.chosen}`;
    this.#canvas.dataset["behind"] = behind ? state.behind : "none";
  }

  #toScreen(): void {
    const ratio = window.devicePixelRatio || 1;
    this.#pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  #toMetres(): void {
    const ratio = window.devicePixelRatio || 1, { scale, x, y } = this.#view;
    this.#pen.setTransform(ratio * scale, 0, 0, -ratio * scale, ratio * x, ratio * y);
  }

  *#visible(): Generator<number> {
    const [left, low] = this.#toWall(0, this.#height), [right, high] = this.#toWall(this.#width, 0);
    const boxes = this.#boxes;
    for (let i = 0; i < this.#report.stones.count; i++) {
      const k = 4 * i;
      if (boxes[k + 2]! >= left && boxes[k]! <= right && boxes[k + 3]! >= low && boxes[k + 1]! <= high) yield i;
    }
  }

  #drawStones(quantity: Quantity, palette: Palette, fade: boolean, opacity: number): void {
    const pen = this.#pen;
    const unknown = this.#hatching();
    const plain = quantity.key === "opening" ? css("--stone") : null;
    for (const i of this.#visible()) {
      const fill = plain ?? stoneColour(this.#report, quantity, palette, i);
      pen.globalAlpha = opacity * (fill && !plain && isFaded(this.#report, quantity, fade, i) ? FADED : 1);
      pen.fillStyle = fill ?? unknown;
      pen.fill(this.#paths[i]!);
    }
  }

  /** Diagonal lines on grey, at a fixed size on the screen. */
  #hatching(): CanvasPattern | string {
    const size = 7, ratio = window.devicePixelRatio || 1;
    const tile = el("canvas", { width: size * ratio, height: size * ratio });
    const pen = tile.getContext("2d")!;
    pen.scale(ratio, ratio);
    pen.fillStyle = css("--unknown");
    pen.fillRect(0, 0, size, size);
    pen.strokeStyle = css("--hatch");
    pen.lineWidth = 1;
    pen.beginPath();
    for (const shift of [-size, 0, size]) {
      pen.moveTo(shift, size);
      pen.lineTo(shift + size, 0);
    }
    pen.stroke();
    const pattern = this.#pen.createPattern(tile, "repeat");
    if (!pattern) return css("--unknown");
    const scale = 1 / (this.#view.scale * ratio);
    pattern.setTransform(new DOMMatrix([scale, 0, 0, -scale, 0, 0]));
    return pattern;
  }

  #drawChange(palette: Palette, fade: boolean, opacity: number): void {
    const { a, u, distance, limit } = this.#report.change;
    const pen = this.#pen;
    const [left, low] = this.#toWall(0, this.#height), [right, high] = this.#toWall(this.#width, 0);
    const half = Math.max(CHANGE_HALF_M, 0.8 / this.#view.scale);
    for (let i = 0; i < a.length; i++) {
      const [x, y] = [a[i]!, u[i]!];
      if (!(x >= left && x <= right && y >= low && y <= high)) continue;
      pen.globalAlpha = opacity * (fade && Math.abs(distance[i]!) <= limit[i]! ? FADED : 1);
      pen.fillStyle = palette.of(distance[i]! * 1e3);
      pen.fillRect(x - half, y - half, 2 * half, 2 * half);
    }
  }

  #drawJoints(palette: Palette, fade: boolean): void {
    const { count, ends: [a1, u1, a2, u2], opening, sigma } = this.#report.joints;
    const pen = this.#pen;
    pen.lineCap = "round";
    pen.lineWidth = Math.max(2.5 / this.#view.scale, 0.022);
    for (let i = 0; i < count; i++) {
      if (Number.isNaN(opening[i]!)) continue;
      pen.globalAlpha = fade && !opens(opening[i]!, sigma[i]!) ? 0.35 : 1;
      pen.strokeStyle = palette.of(opening[i]! * 1e3);
      pen.beginPath();
      pen.moveTo(a1[i]!, u1[i]!);
      pen.lineTo(a2[i]!, u2[i]!);
      pen.stroke();
    }
  }

  #drawOutlines(ink: string, all: boolean): void {
    const { loose } = this.#report.stones;
    const width = Math.max(0.8, Math.min(2, 0.02 * this.#view.scale));
    const fine = this.#view.scale > 40 || all;
    for (const i of this.#visible()) {
      if (loose[i]) {
        // Dark on light, so that it shows on every fill and on every ground.
        this.#outline(i, LIGHT, width + 3);
        this.#outline(i, DARK, width + 0.6);
      }
      else if (fine) {
        this.#pen.globalAlpha = 0.35;
        this.#outline(i, ink, 0.5);
        this.#pen.globalAlpha = 1;
      }
    }
  }

  #outline(i: number, colour: string, px: number): void {
    this.#pen.strokeStyle = colour;
    this.#pen.lineWidth = px / this.#view.scale;
    this.#pen.stroke(this.#paths[i]!);
  }

  #drawArrows(ink: string): void {
    const { stones } = this.#report, [along, up] = stones.move;
    const pen = this.#pen, view = this.#view;
    const lengths: number[] = [];
    for (let i = 0; i < stones.count; i++) if (stones.significant[i]) lengths.push(Math.hypot(along[i]!, up[i]!));
    lengths.sort((p, q) => p - q);
    const reference = lengths[Math.floor(0.98 * (lengths.length - 1))];
    if (!reference) return;
    const taken = new Set<number>();
    pen.beginPath();
    for (const i of this.#visible()) {
      if (!stones.significant[i]) continue;
      const x = view.x + stones.a[i]! * view.scale, y = view.y - stones.u[i]! * view.scale;
      const cell = Math.round(x / ARROW_SPACING_PX) * 100_003 + Math.round(y / ARROW_SPACING_PX);
      if (taken.has(cell)) continue;
      taken.add(cell);
      const factor = ARROW_PX / Math.max(reference, Math.hypot(along[i]!, up[i]!));
      arrow(pen, x, y, along[i]! * factor, -up[i]! * factor);
    }
    arrow(pen, 14, 18, ARROW_PX, 0);
    this.#strokeTwice(1.4);
    this.#label(14 + ARROW_PX + 8, 22, t("inPlane", { length: fixed(reference * 1e3, reference < 0.01 ? 1 : 0) }), ink);
  }

  #drawLine({ a1, u1, a2, u2 }: Line, ink: string): void {
    const pen = this.#pen, { scale, x, y } = this.#view;
    pen.beginPath();
    pen.moveTo(x + a1 * scale, y - u1 * scale);
    pen.lineTo(x + a2 * scale, y - u2 * scale);
    this.#strokeTwice(1.8);
    this.#label(x + a1 * scale + 5, y - u1 * scale - 6, "0 m", ink);
    // A label at the right edge goes inside.
    const end = x + a2 * scale;
    this.#label(end > this.#width - 45 ? this.#width - 45 : end + 5, y - u2 * scale - 6, `${fixed(Math.hypot(a2 - a1, u2 - u1), 1)} m`, ink);
  }

  /** Dark on light, so that it shows on every fill and on every ground. */
  #strokeTwice(width: number): void {
    const pen = this.#pen;
    pen.lineJoin = pen.lineCap = "round";
    pen.strokeStyle = LIGHT;
    pen.lineWidth = width + 2.4;
    pen.globalAlpha = 0.8;
    pen.stroke();
    pen.strokeStyle = DARK;
    pen.lineWidth = width;
    pen.globalAlpha = 1;
    pen.stroke();
  }

  #label(x: number, y: number, text: string, ink: string): void {
    const pen = this.#pen;
    pen.font = "12px system-ui, sans-serif";
    pen.lineWidth = 3;
    pen.strokeStyle = css("--panel");
    pen.lineJoin = "round";
    pen.strokeText(text, x, y);
    pen.fillStyle = ink;
    pen.fillText(text, x, y);
  }

  #drawScaleBar(ink: string): void {
    const metres = 130 / this.#view.scale, power = 10 ** Math.floor(Math.log10(metres));
    const nice = ([5, 2, 1].find((s) => s * power <= metres) ?? 1) * power;
    this.#pen.fillStyle = ink;
    this.#pen.fillRect(14, this.#height - 14, nice * this.#view.scale, 3);
    this.#label(14, this.#height - 20, nice < 1 ? `${Math.round(nice * 100)} cm` : `${nice} m`, ink);
  }

  #listen(): void {
    const canvas = this.#canvas, store = this.#store;
    canvas.addEventListener("pointerdown", (e) => {
      const line = store.get().tool === "profile";
      this.#drag = { x: e.offsetX, y: e.offsetY, moved: false, line };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => this.#move(e));
    canvas.addEventListener("pointerup", (e) => {
      const drag = this.#drag;
      this.#drag = null;
      if (!drag) return;
      if (!drag.moved) store.set({ chosen: this.#at(e.offsetX, e.offsetY) });
      else if (drag.line) store.set({ tool: "move" });
    });
    canvas.addEventListener("pointercancel", () => (this.#drag = null));
    canvas.addEventListener("pointerleave", () => {
      this.#showTip(-1, 0, 0);
      store.set({ hover: -1 });
    });
    canvas.addEventListener("dblclick", (e) => this.#zoomAt(2, e.offsetX, e.offsetY));
    canvas.addEventListener("wheel", (e) => {
      // The page scrolls over a map that nobody has touched.
      if (document.activeElement !== canvas && !e.ctrlKey) return;
      e.preventDefault();
      this.#zoomAt(Math.exp(-e.deltaY / 400), e.offsetX, e.offsetY);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      if (this.#press(e.key)) e.preventDefault();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
  }

  #move(e: PointerEvent): void {
    const drag = this.#drag, store = this.#store;
    if (!drag) {
      const stone = this.#at(e.offsetX, e.offsetY);
      this.#showTip(stone, e.offsetX, e.offsetY);
      store.set({ hover: stone });
      return;
    }
    if (Math.hypot(e.offsetX - drag.x, e.offsetY - drag.y) > 3) drag.moved = true;
    if (!drag.moved) return;
    if (drag.line) {
      const [a1, u1] = this.#toWall(drag.x, drag.y), [a2, u2] = this.#toWall(e.offsetX, e.offsetY);
      store.set({ profile: { a1, u1, a2, u2 } });
      return;
    }
    this.#view = { ...this.#view, x: this.#view.x + e.offsetX - drag.x, y: this.#view.y + e.offsetY - drag.y };
    drag.x = e.offsetX;
    drag.y = e.offsetY;
    this.redraw();
  }

  #press(key: string): boolean {
    const shift: Record<string, [number, number]> = {
      ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60],
    };
    const by = shift[key];
    if (by) {
      this.#view = { ...this.#view, x: this.#view.x + by[0], y: this.#view.y + by[1] };
      this.redraw();
    } else if (key === "+" || key === "=") this.zoom(1.5);
    else if (key === "-") this.zoom(1 / 1.5);
    else if (key === "Home") this.whole();
    else if (key === "Escape") this.#store.set({ chosen: -1, profile: null, tool: "move" });
    else return false;
    return true;
  }

  #showTip(stone: number, px: number, py: number): void {
    this.#tip.hidden = stone < 0;
    if (stone < 0) return;
    this.#tip.textContent = stoneFacts(this.#report, stone);
    this.#tip.style.left = `${Math.max(0, Math.min(px + 14, this.#width - this.#tip.offsetWidth - 4))}px`;
    this.#tip.style.top = `${Math.max(0, py - 34)}px`;
  }
}

/** Adds the shaft and head of an arrow to the current path. */
function arrow(pen: CanvasRenderingContext2D, x: number, y: number, dx: number, dy: number): void {
  const length = Math.hypot(dx, dy), head = Math.min(5.5, 0.45 * length) / (length || 1);
  const [bx, by] = [dx * head, dy * head];
  pen.moveTo(x, y);
  pen.lineTo(x + dx, y + dy);
  pen.moveTo(x + dx - bx + 0.6 * by, y + dy - by - 0.6 * bx);
  pen.lineTo(x + dx, y + dy);
  pen.lineTo(x + dx - bx - 0.6 * by, y + dy - by + 0.6 * bx);
}
