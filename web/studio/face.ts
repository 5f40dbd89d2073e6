// The face of the wall with the outlines of its stones, and the shapes that a person draws on it.

import type { Report } from "../src/data.ts";
import { ringOf } from "../src/data.ts";
import { css, el } from "../src/dom.ts";
import { Squares, contains } from "../src/geometry.ts";
import { Backdrop } from "../src/views/backdrop.ts";
import type { Photos } from "../src/views/photos.ts";
import type { StoneChange, Edit } from "./api.ts";
import { tx } from "./texts.ts";
import { type Box, Tiles } from "./tiles.ts";

export type Point = [number, number];

/** A polygon with a name, such as a zone. */
export interface Area {
  readonly name: string;
  readonly polygon: readonly Point[];
}

/** The colours of an area's border and name. */
type AreaColours = readonly [string, string];
const ZONE: AreaColours = ["#b45cff", "#7a1fd1"], STABLE: AreaColours = ["#12a3a3", "#006a6a"];

/** What is drawn at the moment: a line, a polygon, or a box by two opposite corners. */
interface Drawing {
  readonly kind: "line" | "polygon" | "box";
  readonly points: Point[];
  readonly done: (points: Point[]) => void;
}

/** Colours of stones that come, go or change. */
const FATES = { new: "#18b26b", gone: "#e0402f", changed: "#ff8a1f" } as const;

/** From this scale on outlines lie on a dark line, pixels in a metre; below, they are as thin as a pixel, which is drawn fifteen times as fast. */
const CASED = 120;
/** Pixels that a pointer may move between pressing and letting go and still click. */
const STILL_PX = 4;
/** A click this near to the first vertex closes a polygon, pixels. */
const CLOSE_PX = 9;

export class Face {
  readonly element: HTMLElement;
  /** Called when a person chose other stones. */
  onSelect: () => void = () => {};
  /** Called when a drawing begins or ends. */
  onDrawing: (isDrawing: boolean) => void = () => {};
  readonly selected = new Set<number>();
  /** Edits that the stones shown do not have yet. */
  pending: readonly Edit[] = [];
  zones: readonly Area[] = [];
  stable: readonly Area[] = [];
  /** Stones that another detector would change. */
  changes: readonly StoneChange[] = [];
  #epoch: 0 | 1 = 0;
  readonly #report: Report;
  readonly #canvas: HTMLCanvasElement;
  readonly #pen: CanvasRenderingContext2D;
  readonly #paths: Path2D[] = [];
  readonly #rings: Float64Array[] = [];
  readonly #boxes: Box[] = [];
  readonly #squares = new Squares(1);
  readonly #backdrop: Backdrop;
  readonly #still: Tiles;
  readonly #box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
  #view = { scale: 100, x: 0, y: 0 };
  #size = { width: 0, height: 0 };
  #drawing: Drawing | null = null;
  #pointer: Point | null = null;
  #hover = -1;
  #asked = false;
  #hasBackdrop = false;

  constructor(report: Report, photos: Photos) {
    this.#report = report;
    this.#canvas = el("canvas", { tabindex: 0, role: "application", "aria-label": tx("wallFace") });
    this.#pen = this.#canvas.getContext("2d")!;
    this.element = el("div", { class: "face" }, this.#canvas);
    for (let i = 0; i < report.stones.count; i++) {
      const ring = ringOf(report.stones, i), path = new Path2D();
      const box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
      for (let k = 0; k < ring.length; k += 2) {
        const [x, y] = [ring[k]!, ring[k + 1]!];
        if (k === 0) path.moveTo(x, y);
        else path.lineTo(x, y);
        [box[0], box[1], box[2], box[3]] = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
      }
      path.closePath();
      this.#paths.push(path);
      this.#rings.push(ring);
      this.#boxes.push(box);
      if (ring.length < 6) continue;
      this.#squares.add(i, ...box);
      [this.#box[0], this.#box[1]] = [Math.min(this.#box[0], box[0]), Math.min(this.#box[1], box[1])];
      [this.#box[2], this.#box[3]] = [Math.max(this.#box[2], box[2]), Math.max(this.#box[3], box[3])];
    }
    this.#still = new Tiles((pen, box) => this.#paintStill(pen, box), () => this.redraw());
    this.#backdrop = new Backdrop(report, photos, this.#paths, () => this.#still.forget());
    new ResizeObserver(() => this.#resize()).observe(this.element);
    this.#listen();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#still.forget());
  }

  /** The epoch whose photos are shown. */
  set epoch(epoch: 0 | 1) {
    this.#epoch = epoch;
    this.#still.forget();
  }

  /** Begins a drawing; `done` gets its vertices, of a box its two corners. */
  draw(kind: Drawing["kind"], done: Drawing["done"]): void {
    this.#drawing = { kind, points: [], done };
    this.#canvas.focus();
    this.onDrawing(true);
    this.redraw();
  }

  /** Ends the drawing: with what was drawn, if that is a shape. */
  finish(): void {
    const drawing = this.#drawing;
    if (!drawing) return;
    const least = drawing.kind === "polygon" ? 3 : 2;
    if (drawing.points.length < least) return;
    this.cancel();
    drawing.done(drawing.points);
  }

  /** Ends the drawing without a shape. */
  cancel(): void {
    this.#drawing = null;
    this.onDrawing(false);
    this.redraw();
  }

  get isDrawing(): boolean {
    return this.#drawing !== null;
  }

  /** Chooses one stone and brings it into view. */
  choose(stone: number): void {
    this.selected.clear();
    this.selected.add(stone);
    const ring = this.#rings[stone]!;
    let extent = 0.2;
    const [a, u] = [this.#report.stones.a[stone]!, this.#report.stones.u[stone]!];
    for (let k = 0; k < ring.length; k += 2) extent = Math.max(extent, Math.abs(ring[k]! - a), Math.abs(ring[k + 1]! - u));
    const { width, height } = this.#size;
    const scale = Math.min(width, height) / (6 * extent);
    this.#view = { scale, x: width / 2 - a * scale, y: height / 2 + u * scale };
    this.onSelect();
    this.redraw();
  }

  /** Brings a place of the wall into view. */
  look(outline: readonly (readonly [number, number])[]): void {
    if (outline.length === 0) return;
    const [along, up] = [0, 1].map((axis) => outline.map((p) => p[axis]!)) as [number[], number[]];
    const middle = (values: number[]) => (Math.min(...values) + Math.max(...values)) / 2;
    const extent = Math.max(0.2, ...[along, up].map((values) => (Math.max(...values) - Math.min(...values)) / 2));
    const { width, height } = this.#size, scale = Math.min(width, height) / (6 * extent);
    this.#view = { scale, x: width / 2 - middle(along) * scale, y: height / 2 + middle(up) * scale };
    this.redraw();
  }

  /** The whole wall. */
  whole(): void {
    const [left, low, right, high] = this.#box, { width, height } = this.#size;
    if (!(right > left) || width === 0) return;
    const scale = 0.94 * Math.min(width / (right - left), height / (high - low));
    this.#view = { scale, x: width / 2 - ((left + right) / 2) * scale, y: height / 2 + ((low + high) / 2) * scale };
    this.redraw();
  }

  zoom(factor: number): void {
    this.#zoomAt(factor, this.#size.width / 2, this.#size.height / 2);
  }

  redraw(): void {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.#paint();
    });
  }

  #resize(): void {
    const ratio = window.devicePixelRatio || 1, first = this.#size.width === 0;
    const { clientWidth: width, clientHeight: height } = this.element;
    this.#size = { width, height };
    this.#canvas.width = Math.round(width * ratio);
    this.#canvas.height = Math.round(height * ratio);
    if (first) this.whole();
    else this.redraw();
  }

  #toWall(px: number, py: number): Point {
    return [(px - this.#view.x) / this.#view.scale, (this.#view.y - py) / this.#view.scale];
  }

  #toScreen([along, up]: readonly [number, number]): Point {
    return [this.#view.x + along * this.#view.scale, this.#view.y - up * this.#view.scale];
  }

  /** The stone at a place on the wall, -1 for none. */
  #at([along, up]: Point): number {
    for (const i of this.#squares.at(along, up)) if (contains(this.#rings[i]!, along, up)) return i;
    return -1;
  }

  #zoomAt(factor: number, px: number, py: number): void {
    const { scale, x, y } = this.#view;
    const next = Math.min(20_000, Math.max(2, scale * factor)), by = next / scale;
    this.#view = { scale: next, x: px - (px - x) * by, y: py - (py - y) * by };
    this.redraw();
  }

  #pan(dx: number, dy: number): void {
    this.#view = { ...this.#view, x: this.#view.x + dx, y: this.#view.y + dy };
    this.redraw();
  }

  #listen(): void {
    const canvas = this.#canvas, touches = new Map<number, Point>();
    let pressed: { at: Point; moved: boolean } | null = null;
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      touches.set(e.pointerId, [e.offsetX, e.offsetY]);
      pressed = { at: [e.offsetX, e.offsetY], moved: touches.size > 1 };
    });
    canvas.addEventListener("pointermove", (e) => {
      const last = touches.get(e.pointerId), now: Point = [e.offsetX, e.offsetY];
      this.#pointer = this.#toWall(...now);
      if (!last || !pressed) {
        const hover = this.#drawing ? -1 : this.#at(this.#pointer);
        if (hover !== this.#hover || this.#drawing) this.redraw();
        this.#hover = hover;
        return;
      }
      if (touches.size === 2) {
        const other = [...touches].find(([id]) => id !== e.pointerId)![1];
        const far = (p: Point) => Math.hypot(p[0] - other[0], p[1] - other[1]);
        this.#zoomAt(far(now) / Math.max(1, far(last)), ...other);
      } else {
        if (Math.hypot(now[0] - pressed.at[0], now[1] - pressed.at[1]) > STILL_PX) pressed.moved = true;
        if (pressed.moved) this.#pan(now[0] - last[0], now[1] - last[1]);
      }
      touches.set(e.pointerId, now);
    });
    canvas.addEventListener("pointerup", (e) => {
      touches.delete(e.pointerId);
      const was = pressed;
      if (touches.size === 0) pressed = null;
      if (was && !was.moved) this.#click([e.offsetX, e.offsetY], e.shiftKey || e.ctrlKey || e.metaKey);
    });
    canvas.addEventListener("pointercancel", (e) => {
      touches.delete(e.pointerId);
      pressed = null;
    });
    canvas.addEventListener("dblclick", () => this.finish());
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.#zoomAt(Math.exp(-e.deltaY / 400), e.offsetX, e.offsetY);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      if (this.#press(e)) {
        e.preventDefault();
        e.stopPropagation();
      }
    });
  }

  #click(at: Point, more: boolean): void {
    const place = this.#toWall(...at), drawing = this.#drawing;
    if (drawing) {
      const first = drawing.points[0];
      if (first && drawing.kind === "polygon" && drawing.points.length > 2) {
        const [x, y] = this.#toScreen(first);
        if (Math.hypot(x - at[0], y - at[1]) < CLOSE_PX) return this.finish();
      }
      this.#vertex(place);
      return;
    }
    const stone = this.#at(place);
    if (!more) this.selected.clear();
    if (stone >= 0) {
      if (more && this.selected.has(stone)) this.selected.delete(stone);
      else this.selected.add(stone);
    }
    this.onSelect();
    this.redraw();
  }

  /** Adds a vertex, unless it lies where the last one does. */
  #vertex(place: Point): void {
    const points = this.#drawing!.points, last = points.at(-1);
    const near = 2 / this.#view.scale;
    if (last && Math.hypot(last[0] - place[0], last[1] - place[1]) < near) return;
    // A millimetre is finer than anyone draws.
    points.push([Math.round(place[0] * 1e3) / 1e3, Math.round(place[1] * 1e3) / 1e3]);
    if (this.#drawing!.kind === "box" && points.length === 2) this.finish();
    this.redraw();
  }

  #press(e: KeyboardEvent): boolean {
    const by: Record<string, Point> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const arrow = by[e.key];
    if (arrow && this.#drawing) {
      const step = (e.shiftKey ? 40 : 8) / this.#view.scale;
      const from = this.#pointer ?? this.#toWall(this.#size.width / 2, this.#size.height / 2);
      this.#pointer = [from[0] + arrow[0] * step, from[1] - arrow[1] * step];
      this.redraw();
    } else if (arrow) this.#pan(-60 * arrow[0], -60 * arrow[1]);
    else if (e.key === "+" || e.key === "=") this.zoom(1.5);
    else if (e.key === "-") this.zoom(1 / 1.5);
    else if (e.key === "Home") this.whole();
    else if (!this.#drawing) return false;
    else if (e.key === "Enter") this.finish();
    else if (e.key === "Escape") this.cancel();
    else if (e.key === "Backspace") {
      this.#drawing.points.pop();
      this.redraw();
    } else if (e.key === " ") this.#vertex(this.#pointer ?? this.#toWall(this.#size.width / 2, this.#size.height / 2));
    else return false;
    return true;
  }

  /** Photos and outlines in a part of the wall. */
  #paintStill(pen: CanvasRenderingContext2D, [left, low, right, high]: Box): void {
    const ratio = window.devicePixelRatio || 1, scale = pen.getTransform().a / ratio;
    pen.fillStyle = css("--ground");
    pen.fillRect(left, low, right - left, high - low);
    this.#hasBackdrop = this.#backdrop.draw(pen, this.#epoch);
    pen.lineJoin = "round";
    const margin = 2 / scale;
    for (let i = 0; i < this.#paths.length; i++) {
      const [west, south, east, north] = this.#boxes[i]!;
      if (west > right + margin || east < left - margin || south > high + margin || north < low - margin) continue;
      if (scale > CASED) {
        stroke(pen, this.#paths[i]!, "#0008", 2.6 / scale);
        stroke(pen, this.#paths[i]!, "#ffe25a", 1.1 / scale);
      } else stroke(pen, this.#paths[i]!, "#ffe25a", 1 / (ratio * scale));
    }
  }

  #paint(): void {
    const pen = this.#pen, ratio = window.devicePixelRatio || 1, { scale, x, y } = this.#view;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    const { width, height } = this.#canvas;
    pen.fillStyle = css("--ground");
    pen.fillRect(0, 0, width, height);
    const isPainted = this.#still.draw(pen, { scale: scale * ratio, x: x * ratio, y: y * ratio }, width, height);
    this.#canvas.dataset["backdrop"] = String(this.#hasBackdrop && isPainted);
    pen.setTransform(ratio * scale, 0, 0, -ratio * scale, ratio * x, ratio * y);
    const line = (path: Path2D, colour: string, px: number) => stroke(pen, path, colour, px / scale);
    pen.lineJoin = "round";
    if (this.#hover >= 0 && this.#hover < this.#paths.length) line(this.#paths[this.#hover]!, "#fff", 2.4);
    for (const i of this.selected) {
      pen.fillStyle = "#2f9bff55";
      pen.fill(this.#paths[i]!);
      line(this.#paths[i]!, "#fff", 4);
      line(this.#paths[i]!, "#0a6ed1", 2.2);
    }
    for (const zone of this.zones) this.#area(zone, ZONE);
    for (const area of this.stable) this.#area(area, STABLE);
    for (const { outline, fate } of this.changes) this.#trace(outline, true, FATES[fate], 2.4, fate === "gone" ? [4, 4] : []);
    for (const edit of this.pending) this.#edit(edit);
    this.#sketch();
    this.#canvas.dataset["drawn"] = "true";
  }

  /** A correction that the outlines do not show yet. */
  #edit(edit: Edit): void {
    const pen = this.#pen, { scale } = this.#view;
    if (edit.photo) return;
    const colour = edit.do === "delete" || edit.do === "ignore" ? "#e0402f" : "#18b26b";
    for (const place of edit.at ?? []) {
      const stone = this.#at([place[0], place[1]]);
      if (stone < 0) continue;
      pen.fillStyle = `${colour}66`;
      pen.fill(this.#paths[stone]!);
    }
    if (edit.do === "merge" && edit.at) this.#trace(edit.at, false, colour, 3);
    if (edit.do === "delete") {
      for (const [px, py] of edit.at ?? []) {
        const arm = 7 / scale;
        for (const sign of [1, -1]) this.#trace([[px - arm, py - sign * arm], [px + arm, py + sign * arm]], false, colour, 3);
      }
    }
    if (edit.line?.length) this.#trace(edit.line, false, colour, 3);
    if (edit.box?.length) this.#trace(rectangle(edit.box), true, colour, 2.4);
    if (edit.outline?.length) this.#trace(edit.outline, true, colour, 2.4, edit.do === "ignore" ? [6, 4] : []);
  }

  #area({ polygon, name }: Area, [border, ink]: AreaColours): void {
    this.#trace(polygon, true, border, 2.4, [9, 5]);
    const first = polygon[0];
    if (first) this.#label(this.#toScreen(first), name, ink);
  }

  #sketch(): void {
    const drawing = this.#drawing;
    if (!drawing) return;
    const points = [...drawing.points];
    if (this.#pointer) points.push(this.#pointer);
    if (drawing.kind === "box") this.#trace(rectangle(points), true, "#0a6ed1", 2);
    else this.#trace(points, drawing.kind === "polygon" && points.length > 2, "#0a6ed1", 2);
    const pen = this.#pen, ratio = window.devicePixelRatio || 1;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const point of drawing.points) {
      const [x, y] = this.#toScreen(point);
      pen.fillStyle = "#fff";
      pen.strokeStyle = "#0a6ed1";
      pen.lineWidth = 2;
      pen.fillRect(x - 3, y - 3, 6, 6);
      pen.strokeRect(x - 3, y - 3, 6, 6);
    }
    if (!this.#pointer) return;
    const [x, y] = this.#toScreen(this.#pointer);
    for (const [colour, width] of [["#fff", 3.4], ["#0a6ed1", 1.4]] as const) {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.beginPath();
      pen.moveTo(x - 10, y);
      pen.lineTo(x + 10, y);
      pen.moveTo(x, y - 10);
      pen.lineTo(x, y + 10);
      pen.stroke();
    }
  }

  /** A line of this width on the screen, light behind it, so that it shows on every ground. */
  #trace(points: readonly (readonly [number, number])[], closed: boolean, colour: string, px: number, dashes: readonly number[] = []): void {
    const pen = this.#pen, ratio = window.devicePixelRatio || 1;
    pen.save();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.beginPath();
    points.forEach((point, k) => {
      const [x, y] = this.#toScreen(point);
      if (k === 0) pen.moveTo(x, y);
      else pen.lineTo(x, y);
    });
    if (closed) pen.closePath();
    pen.lineJoin = pen.lineCap = "round";
    pen.strokeStyle = "#fffc";
    pen.lineWidth = px + 2.4;
    pen.stroke();
    pen.setLineDash([...dashes]);
    pen.strokeStyle = colour;
    pen.lineWidth = px;
    pen.stroke();
    pen.restore();
  }

  #label([x, y]: Point, text: string, ink: string): void {
    const pen = this.#pen, ratio = window.devicePixelRatio || 1;
    pen.save();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "600 13px system-ui, sans-serif";
    pen.lineWidth = 3.5;
    pen.strokeStyle = "#fff";
    pen.lineJoin = "round";
    pen.strokeText(text, x + 4, y - 6);
    pen.fillStyle = ink;
    pen.fillText(text, x + 4, y - 6);
    pen.restore();
  }
}

function stroke(pen: CanvasRenderingContext2D, path: Path2D, colour: string, width: number): void {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke(path);
}

/** The corners of a box, of which two opposite ones are given. */
export function rectangle(points: readonly (readonly [number, number])[]): Point[] {
  const [first, last] = [points[0], points.at(-1)];
  if (!first || !last) return [];
  return [[first[0], first[1]], [last[0], first[1]], [last[0], last[1]], [first[0], last[1]]];
}
