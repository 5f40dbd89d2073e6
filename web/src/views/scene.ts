// The wall in space: stones as coloured patches, displacement arrows, thinned clouds, cameras (three.js).

import {
  BufferAttribute, BufferGeometry, Color, ConeGeometry, DoubleSide, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshBasicMaterial, PerspectiveCamera, Points, PointsMaterial, Quaternion, Raycaster, Scene, ShapeUtils, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { type Report, isMeasured, norm } from "../data.ts";
import { button, css, el } from "../dom.ts";
import { fixed, mm } from "../format.ts";
import { faceAxes } from "../geometry.ts";
import { Palette, type Quantity, isFaded, opens, stoneColour } from "../quantities.ts";
import type { Store } from "../store.ts";
import { type TextKey, t } from "../texts.ts";

type Clouds = "none" | "before" | "after" | "both";
const CLOUDS: readonly (readonly [Clouds, TextKey])[] = [["none", "cloudNone"], ["before", "cloudBefore"], ["after", "cloudAfter"], ["both", "cloudBoth"]];

/** Patches stand this far before the plane of their stone, so that its relief does not hide them, metres. */
const LIFT_M = 0.02;
/** Beyond this number of stones outlines are left out and edges are not smoothed: they would be finer than a pixel. */
const MANY_STONES = 3000;
/** Half the width of a joint's ribbon, in square roots of the median stone's area. */
const RIBBON = 0.035;
/** How far cameras are drawn in front of their centres, metres. */
const CAMERA_M = 0.5;

/** One camera of the scene, for its name under the pointer. */
interface NamedPlace {
  readonly name: string;
  readonly place: Vector3;
}

/** The 3D view. */
export class WallScene {
  readonly element: HTMLElement;
  readonly #report: Report;
  readonly #store: Store;
  readonly #quantities: ReadonlyMap<string, Quantity>;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(40, 1, 0.05, 2000);
  readonly #controls: OrbitControls;
  readonly #tip = el("div", { class: "tip", hidden: true });
  readonly #middle = new Vector3();
  readonly #normal = new Vector3();
  /** Radius of a ball around the wall, metres. */
  #radius = 1;
  /** Displacement of every stone in the world, metres. */
  readonly #moves: Vector3[] = [];
  #patches!: Mesh<BufferGeometry, MeshBasicMaterial>;
  #base!: Float32Array;
  /** First vertex of every stone's patch, and one past the last. */
  readonly #firstVertex: number[] = [];
  #stoneOfTriangle: Int32Array = new Int32Array();
  /** Outline of the chosen stone, light below dark, so that it shows on every colour. */
  #ring!: Mesh<BufferGeometry, MeshBasicMaterial>;
  #edges!: LineSegments<BufferGeometry, LineBasicMaterial>;
  #shafts!: LineSegments<BufferGeometry, LineBasicMaterial>;
  #heads!: InstancedMesh<ConeGeometry, MeshBasicMaterial>;
  #ribbons!: Mesh<BufferGeometry, MeshBasicMaterial>;
  #panelElement!: HTMLElement;
  #frusta: LineSegments | null = null;
  readonly #cameras: NamedPlace[] = [];
  readonly #clouds: [Points | null, Points | null] = [null, null];
  #exaggeration = 1;
  #after = false;
  #shown: { clouds: Clouds; stones: boolean; arrows: boolean; cameras: boolean } = { clouds: "before", stones: true, arrows: true, cameras: false };
  #waiting = false;
  /** Whether the view has the size of its place. */
  #placed = false;

  constructor(report: Report, store: Store, quantities: readonly Quantity[]) {
    this.#report = report;
    this.#store = store;
    this.#quantities = new Map(quantities.map((q) => [q.key, q]));
    const canvas = el("canvas", {
      tabindex: 0, role: "application",
      "aria-label": t("sceneName"),
    });
    this.#renderer = new WebGLRenderer({ canvas, antialias: report.stones.count <= MANY_STONES, preserveDrawingBuffer: true });
    this.#controls = new OrbitControls(this.#camera, canvas);
    this.#controls.listenToKeyEvents(canvas);
    this.#controls.addEventListener("change", () => this.redraw());
    this.#camera.up.set(0, 0, 1);
    this.#survey();
    this.#buildPatches();
    this.#buildRing();
    this.#buildArrows();
    this.#buildRibbons();
    this.#buildCameras();
    this.#exaggeration = this.#usualExaggeration();
    this.#panelElement = this.#panel();
    this.element = el("div", { class: "wall-scene" }, canvas, this.#tip, this.#panelElement);
    this.#listen(canvas);
    store.on(() => this.#recolour());
    new ResizeObserver(() => this.#resize()).observe(this.element);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#recolour());
    void this.#openClouds();
    this.#recolour();
    this.#move();
    this.look("front");
  }

  /** Draws at the next frame. */
  redraw(): void {
    if (this.#waiting) return;
    this.#waiting = true;
    requestAnimationFrame(() => {
      this.#waiting = false;
      if (this.element.clientWidth === 0) return;
      this.#renderer.render(this.#scene, this.#camera);
      this.#renderer.domElement.dataset["drawn"] = String(this.#renderer.info.render.frame);
    });
  }

  zoom(by: number): void {
    const { target } = this.#controls;
    this.#camera.position.sub(target).multiplyScalar(1 / by).add(target);
    this.#controls.update();
    this.redraw();
  }

  whole(): void {
    this.look("front");
  }

  /** Looks at the whole wall from a side. */
  look(from: "front" | "left" | "right" | "above"): void {
    const along = new Vector3(...(faceAxes(this.#normal.toArray()).along as [number, number, number]));
    const direction = this.#normal.clone();
    if (from === "left") direction.multiplyScalar(0.35).addScaledVector(along, -1);
    if (from === "right") direction.multiplyScalar(0.35).addScaledVector(along, 1);
    if (from === "above") direction.multiplyScalar(0.5).add(new Vector3(0, 0, 1));
    const { clientWidth: width, clientHeight: height } = this.element;
    // The controls cover the lower part of the picture: the wall takes what is left.
    const free = height > 0 ? Math.max(0.4, 1 - (this.#panelElement.offsetHeight + 16) / height) : 1;
    const distance = this.#radius / Math.tan((this.#camera.fov * Math.PI) / 360) / Math.min(free, this.#camera.aspect) * 0.88;
    if (height > 0) this.#camera.setViewOffset(width, height, 0, ((1 - free) / 2) * height, width, height);
    this.#camera.position.copy(this.#middle).addScaledVector(direction.normalize(), distance);
    this.#controls.target.copy(this.#middle);
    this.#controls.update();
    this.redraw();
  }

  #position(i: number): Vector3 {
    const [x, y, z] = this.#report.stones.position;
    return new Vector3(x[i], y[i], z[i]);
  }

  /** Middle, mean normal and size of the wall; displacements in the world. */
  #survey(): void {
    const { stones } = this.#report;
    let count = 0;
    for (let i = 0; i < stones.count; i++) {
      const n = stones.normal.map((v) => v[i]!) as [number, number, number];
      const { along, up, out } = faceAxes(n);
      const d = stones.move.map((v) => v[i]!);
      const move = new Vector3();
      if (isMeasured(stones, i)) [along, up, out].forEach((axis, k) => move.addScaledVector(new Vector3(...(axis as [number, number, number])), d[k]!));
      this.#moves.push(move);
      const p = this.#position(i);
      if (Number.isNaN(p.x + p.y + p.z)) continue;
      this.#middle.add(p);
      this.#normal.add(new Vector3(...n));
      count++;
    }
    this.#middle.multiplyScalar(1 / Math.max(1, count));
    if (this.#normal.length() < 1e-9) this.#normal.set(1, 0, 0);
    this.#normal.normalize();
    for (let i = 0; i < stones.count; i++) {
      const away = this.#position(i).distanceTo(this.#middle);
      if (away > this.#radius) this.#radius = away;
    }
  }

  /** Exaggeration at which large motions are about as long as a stone. */
  #usualExaggeration(): number {
    const { stones } = this.#report;
    const lengths: number[] = [], sizes: number[] = [];
    for (let i = 0; i < stones.count; i++) {
      sizes.push(Math.sqrt(stones.area[i]!));
      if (isMeasured(stones, i)) lengths.push(norm(stones.move, i));
    }
    const at = (values: number[], q: number) => values.sort((p, r) => p - r)[Math.floor(q * (values.length - 1))] ?? 0;
    const wanted = (1.5 * at(sizes, 0.5)) / (at(lengths, 0.98) || 1);
    const power = 10 ** Math.floor(Math.log10(Math.max(1, wanted)));
    return Math.max(1, ([5, 2, 1].find((s) => s * power <= wanted) ?? 1) * power);
  }

  #buildPatches(): void {
    const { stones } = this.#report;
    const places: number[] = [], owners: number[] = [], lines: number[] = [];
    for (let i = 0; i < stones.count; i++) {
      this.#firstVertex.push(places.length / 3);
      const from = i === 0 ? 0 : stones.ringEnd[i - 1]!;
      const flat: Vector2[] = [];
      for (let k = from; k < stones.ringEnd[i]!; k++) flat.push(new Vector2(stones.ring[2 * k], stones.ring[2 * k + 1]));
      const { along, up, out } = faceAxes(stones.normal.map((v) => v[i]!));
      const c = this.#position(i);
      const world = flat.map((p) => [0, 1, 2].map((k) => c.getComponent(k) + p.x * along[k]! + p.y * up[k]! + LIFT_M * out[k]!));
      for (const triangle of ShapeUtils.triangulateShape(flat, [])) {
        for (const corner of triangle) places.push(...world[corner]!);
        owners.push(i);
      }
      if (stones.count <= MANY_STONES) world.forEach((p, k) => lines.push(...p, ...world[(k + 1) % world.length]!));
    }
    this.#firstVertex.push(places.length / 3);
    this.#base = new Float32Array(places);
    this.#stoneOfTriangle = new Int32Array(owners);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(this.#base.slice(), 3));
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(this.#base.length), 3));
    this.#patches = new Mesh(geometry, new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, transparent: true, opacity: 0.82 }));
    const outline = new BufferGeometry();
    outline.setAttribute("position", new BufferAttribute(new Float32Array(lines), 3));
    this.#edges = new LineSegments(outline, new LineBasicMaterial({ transparent: true, opacity: 0.35 }));
    this.#scene.add(this.#patches, this.#edges);
  }

  #buildArrows(): void {
    const { stones } = this.#report;
    const shafts = new BufferGeometry();
    shafts.setAttribute("position", new BufferAttribute(new Float32Array(6 * stones.count), 3));
    this.#shafts = new LineSegments(shafts, new LineBasicMaterial());
    this.#heads = new InstancedMesh(new ConeGeometry(0.018, 0.06, 6, 1, true), new MeshBasicMaterial(), stones.count);
    this.#shafts.frustumCulled = this.#heads.frustumCulled = false;
    this.#scene.add(this.#shafts, this.#heads);
  }

  /** Joints as flat ribbons in the face, shown with their opening. */
  #buildRibbons(): void {
    const { stones, joints } = this.#report;
    const areas = Float64Array.from(stones.area).sort();
    const half = RIBBON * Math.sqrt(areas[areas.length >> 1] ?? 0.04);
    const places = new Float32Array(18 * joints.count);
    const [p, q, side] = [new Vector3(), new Vector3(), new Vector3()];
    for (let i = 0; i < joints.count; i++) {
      const normal = new Vector3(...stones.normal.map((v) => v[joints.first[i]!]!));
      p.set(...(joints.world[0].map((v) => v[i]!) as [number, number, number])).addScaledVector(normal, 1.5 * LIFT_M);
      q.set(...(joints.world[1].map((v) => v[i]!) as [number, number, number])).addScaledVector(normal, 1.5 * LIFT_M);
      side.copy(q).sub(p).cross(normal).setLength(half);
      const corners = [p.clone().add(side), p.clone().sub(side), q.clone().add(side), q.clone().sub(side)];
      [0, 1, 2, 2, 1, 3].forEach((corner, k) => places.set(corners[corner]!.toArray(), 18 * i + 3 * k));
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(places, 3));
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(places.length), 3));
    this.#ribbons = new Mesh(geometry, new MeshBasicMaterial({ vertexColors: true, side: DoubleSide }));
    this.#ribbons.frustumCulled = this.#ribbons.visible = false;
    this.#scene.add(this.#ribbons);
  }

  #buildRing(): void {
    this.#ring = new Mesh(new BufferGeometry(), new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, depthTest: false, transparent: true }));
    this.#ring.frustumCulled = false;
    this.#ring.renderOrder = 1;
    this.#scene.add(this.#ring);
  }

  /** Puts the outline around the chosen stone, moved as the stone is. */
  #placeRing(): void {
    const { stones } = this.#report, stone = this.#store.get().chosen;
    this.#ring.visible = stone >= 0 && this.#shown.stones;
    if (stone < 0) return;
    const { along, up, out } = faceAxes(stones.normal.map((v) => v[stone]!));
    const centre = this.#position(stone).addScaledVector(this.#moves[stone]!, this.#after ? this.#exaggeration : 0);
    const from = stone === 0 ? 0 : stones.ringEnd[stone - 1]!, to = stones.ringEnd[stone]!;
    const world = (x: number, y: number) => [0, 1, 2].map((k) => centre.getComponent(k) + x * along[k]! + y * up[k]! + 2 * LIFT_M * out[k]!);
    const places: number[] = [], colours: number[] = [];
    const half = 0.05 * Math.sqrt(stones.area[stone]!);
    for (const [width, name] of [[half, "--panel"], [0.55 * half, "--accent"]] as const) {
      const { r, g, b } = new Color(css(name));
      for (let k = from; k < to; k++) {
        const next = k + 1 < to ? k + 1 : from;
        const [x0, y0, x1, y1] = [stones.ring[2 * k]!, stones.ring[2 * k + 1]!, stones.ring[2 * next]!, stones.ring[2 * next + 1]!];
        const length = Math.hypot(x1 - x0, y1 - y0) || 1, [dx, dy] = [((x1 - x0) / length) * width, ((y1 - y0) / length) * width];
        // Longer by half its width at both ends, so that corners are closed.
        const corner = (end: number, side: number) => {
          const [x, y] = end < 0 ? [x0, y0] : [x1, y1];
          return world(x + end * dx - side * dy, y + end * dy + side * dx);
        };
        const [a, b4, c, d] = [corner(-1, 1), corner(-1, -1), corner(1, 1), corner(1, -1)];
        places.push(...a, ...b4, ...c, ...c, ...b4, ...d);
        for (let v = 0; v < 6; v++) colours.push(r, g, b);
      }
    }
    this.#ring.geometry.dispose();
    this.#ring.geometry = new BufferGeometry();
    this.#ring.geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
    this.#ring.geometry.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
  }

  #recolourRibbons(palette: Palette, fade: boolean, ground: Color): void {
    const { count, opening, sigma } = this.#report.joints;
    const colours = this.#ribbons.geometry.getAttribute("color") as BufferAttribute;
    for (let i = 0; i < count; i++) {
      const value = opening[i]!, colour = new Color(Number.isNaN(value) ? ground : palette.of(value * 1e3));
      if (fade && !opens(value, sigma[i]!)) colour.lerp(ground, 0.65);
      for (let k = 0; k < 6; k++) colours.setXYZ(6 * i + k, colour.r, colour.g, colour.b);
    }
    colours.needsUpdate = true;
  }

  #buildCameras(): void {
    const places: number[] = [];
    for (const camera of this.#report.document.cameras) {
      const c = new Vector3(...camera.centre);
      const corner = (x: number, y: number) =>
        c.clone().addScaledVector(new Vector3(...camera.axis), CAMERA_M).addScaledVector(new Vector3(...camera.right), x * CAMERA_M).addScaledVector(new Vector3(...camera.down), y * CAMERA_M);
      const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
      corners.forEach((p, k) => places.push(...c.toArray(), ...p.toArray(), ...p.toArray(), ...corners[(k + 1) % 4]!.toArray()));
      this.#cameras.push({ name: `${this.#report.document.epochs[camera.epoch - 1] ?? ""}: ${camera.name}`, place: c });
    }
    if (places.length === 0) return;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
    this.#frusta = new LineSegments(geometry, new LineBasicMaterial());
    this.#frusta.visible = false;
    this.#scene.add(this.#frusta);
  }

  async #openClouds(): Promise<void> {
    for (const k of [0, 1] as const) {
      const columns = await this.#report.block(`cloud${k + 1}`);
      if (!columns) continue;
      const axes = ["x", "y", "z"].map((name) => columns.numbers(name));
      const colours = ["red", "green", "blue"].map((name) => columns.integers(name));
      const count = axes[0]!.length;
      const places = new Float32Array(3 * count), tints = new Uint8Array(3 * count);
      for (let i = 0; i < count; i++) {
        for (let c = 0; c < 3; c++) {
          places[3 * i + c] = axes[c]![i]!;
          tints[3 * i + c] = colours[c]![i]!;
        }
      }
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(places, 3));
      geometry.setAttribute("color", new BufferAttribute(tints, 3, true));
      const cloud = new Points(geometry, new PointsMaterial({ size: 2, sizeAttenuation: false, vertexColors: true }));
      this.#clouds[k] = cloud;
      this.#scene.add(cloud);
      this.#show();
    }
    this.element.dataset["clouds"] = String(this.#clouds.filter((c) => c !== null).length);
  }

  /** Places patches and arrows as the switches say. */
  #move(): void {
    const { stones } = this.#report;
    const factor = this.#exaggeration, shift = this.#after ? factor : 0;
    const place = this.#patches.geometry.getAttribute("position") as BufferAttribute;
    const shafts = this.#shafts.geometry.getAttribute("position") as BufferAttribute;
    const matrix = new Matrix4(), up = new Vector3(0, 1, 0), none = new Matrix4().makeScale(0, 0, 0);
    const fade = this.#store.get().fade;
    for (let i = 0; i < stones.count; i++) {
      const d = this.#moves[i]!;
      for (let v = this.#firstVertex[i]!; v < this.#firstVertex[i + 1]!; v++) {
        place.setXYZ(v, this.#base[3 * v]! + d.x * shift, this.#base[3 * v + 1]! + d.y * shift, this.#base[3 * v + 2]! + d.z * shift);
      }
      const from = this.#position(i).addScaledVector(this.#normal, 2 * LIFT_M);
      const shown = isMeasured(stones, i) && (!fade || stones.significant[i]);
      const to = shown ? from.clone().addScaledVector(d, factor) : from;
      shafts.setXYZ(2 * i, from.x, from.y, from.z);
      shafts.setXYZ(2 * i + 1, to.x, to.y, to.z);
      const length = from.distanceTo(to);
      if (!shown || !(length > 1e-6)) {
        this.#heads.setMatrixAt(i, none);
        continue;
      }
      const size = Math.min(1.6, Math.max(0.35, length / 0.15));
      const direction = d.clone().normalize();
      matrix.compose(to.addScaledVector(direction, -0.03 * size), new Quaternion().setFromUnitVectors(up, direction), new Vector3(size, size, size));
      this.#heads.setMatrixAt(i, matrix);
    }
    place.needsUpdate = shafts.needsUpdate = this.#heads.instanceMatrix.needsUpdate = true;
    this.#patches.geometry.computeBoundingSphere();
    this.#placeRing();
    this.#showInPlace();
    this.redraw();
  }

  /** Edges and joints do not move with the stones. */
  #showInPlace(): void {
    const shown = this.#shown.stones && !this.#after;
    this.#edges.visible = shown;
    this.#ribbons.visible = shown && this.#store.get().quantity === "opening";
  }

  #recolour(): void {
    const { quantity: key, fade, chosen, hover } = this.#store.get();
    const quantity = this.#quantities.get(key)!, palette = new Palette(this.#report, quantity);
    const ground = new Color(css("--ground")), unknown = new Color(css("--unknown")), accent = new Color(css("--accent"));
    const colours = this.#patches.geometry.getAttribute("color") as BufferAttribute;
    const plain = new Color(css("--stone"));
    for (let i = 0; i < this.#report.stones.count; i++) {
      const fill = key === "opening" ? null : stoneColour(this.#report, quantity, palette, i);
      const colour = fill ? new Color(fill) : key === "opening" ? plain.clone() : unknown.clone();
      if (fill && isFaded(this.#report, quantity, fade, i)) colour.lerp(ground, 0.7);
      if (i === hover && i !== chosen) colour.lerp(plain, 0.25);
      for (let v = this.#firstVertex[i]!; v < this.#firstVertex[i + 1]!; v++) colours.setXYZ(v, colour.r, colour.g, colour.b);
    }
    colours.needsUpdate = true;
    if (key === "opening") this.#recolourRibbons(palette, fade, plain);
    const ink = new Color(css("--ink"));
    this.#scene.background = ground;
    for (const material of [this.#shafts.material, this.#heads.material, this.#edges.material]) material.color.copy(ink);
    if (this.#frusta) (this.#frusta.material as LineBasicMaterial).color.copy(accent);
    this.#move();
  }

  /** Shows what the switches name. */
  #show(): void {
    const { clouds, stones, arrows, cameras } = this.#shown;
    this.#patches.visible = stones;
    this.#placeRing();
    this.#showInPlace();
    this.#shafts.visible = this.#heads.visible = arrows;
    if (this.#frusta) this.#frusta.visible = cameras;
    if (this.#clouds[0]) this.#clouds[0].visible = clouds === "before" || clouds === "both";
    if (this.#clouds[1]) this.#clouds[1].visible = clouds === "after" || clouds === "both";
    this.redraw();
  }

  #panel(): HTMLElement {
    const check = (text: TextKey, key: "stones" | "arrows" | "cameras") => {
      const box = el("input", { type: "checkbox", ...(this.#shown[key] ? { checked: true } : {}) });
      box.addEventListener("change", () => {
        this.#shown = { ...this.#shown, [key]: box.checked };
        this.#show();
      });
      return el("label", {}, box, t(text));
    };
    const hasClouds = this.#report.document.blocks["cloud1"] !== undefined;
    const clouds = el("select", { id: "clouds" }, ...CLOUDS.map(([c, text]) =>
      el("option", { value: c, ...(c === this.#shown.clouds ? { selected: true } : {}) }, t(text))));
    clouds.addEventListener("change", () => {
      this.#shown = { ...this.#shown, clouds: clouds.value as Clouds };
      this.#show();
    });
    const value = el("output", {}, `\u00d7${fixed(this.#exaggeration, 0)}`);
    const slider = el("input", { type: "range", min: 0, max: 3.3, step: 0.01, value: Math.log10(this.#exaggeration), id: "exaggeration" });
    slider.addEventListener("input", () => {
      this.#exaggeration = Math.round(10 ** Number(slider.value));
      value.textContent = `\u00d7${fixed(this.#exaggeration, 0)}`;
      this.#move();
    });
    const after = el("input", { type: "checkbox", id: "moved" });
    after.addEventListener("change", () => {
      this.#after = after.checked;
      this.#move();
    });
    const looks = (["front", "left", "right", "above"] as const).map((from) => button(t(from), "", () => this.look(from)));
    return el("div", { class: "scene-controls" },
      el("span", { class: "group" }, ...looks),
      el("label", {}, t("motion"), slider, value), el("label", {}, after, t("stonesMoved")),
      check("sceneStones", "stones"), check("sceneArrows", "arrows"),
      hasClouds ? el("label", {}, t("cloud"), clouds) : null, this.#frusta ? check("sceneCameras", "cameras") : null);
  }

  #listen(canvas: HTMLCanvasElement): void {
    let down: [number, number] | null = null;
    canvas.addEventListener("pointerdown", (e) => (down = [e.offsetX, e.offsetY]));
    canvas.addEventListener("pointerup", (e) => {
      if (down && Math.hypot(e.offsetX - down[0], e.offsetY - down[1]) < 4) this.#store.set({ chosen: this.#at(e.offsetX, e.offsetY) });
      down = null;
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!down) this.#point(e.offsetX, e.offsetY);
    });
    canvas.addEventListener("pointerleave", () => {
      this.#tip.hidden = true;
      this.#store.set({ hover: -1 });
    });
  }

  #at(px: number, py: number): number {
    if (!this.#patches.visible) return -1;
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((px / this.element.clientWidth) * 2 - 1, 1 - (py / this.element.clientHeight) * 2), this.#camera);
    const face = ray.intersectObject(this.#patches)[0]?.faceIndex;
    return face === undefined || face === null ? -1 : this.#stoneOfTriangle[face]!;
  }

  #point(px: number, py: number): void {
    const { stones } = this.#report;
    const stone = this.#at(px, py), camera = this.#cameraAt(px, py);
    this.#store.set({ hover: stone });
    this.#tip.hidden = stone < 0 && camera === null;
    if (camera !== null) this.#tip.textContent = camera;
    else if (stone >= 0) this.#tip.textContent = t("stoneFacts", { id: stones.id[stone]!, facts: isMeasured(stones, stone) ? `${mm(norm(stones.move, stone))} mm` : t("unmeasured") });
    this.#tip.style.left = `${px + 14}px`;
    this.#tip.style.top = `${Math.max(0, py - 34)}px`;
  }

  #cameraAt(px: number, py: number): string | null {
    if (!this.#frusta?.visible) return null;
    const { clientWidth: w, clientHeight: h } = this.element;
    const near = this.#cameras.find(({ place }) => {
      const p = place.clone().project(this.#camera);
      return p.z < 1 && Math.hypot(((p.x + 1) / 2) * w - px, ((1 - p.y) / 2) * h - py) < 12;
    });
    return near?.name ?? null;
  }

  #resize(): void {
    const { clientWidth: w, clientHeight: h } = this.element;
    if (w === 0 || h === 0) return;
    this.#renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.#renderer.setSize(w, h, false);
    this.#camera.aspect = w / h;
    this.#camera.updateProjectionMatrix();
    if (!this.#placed) this.look("front");
    this.#placed = true;
    this.redraw();
  }
}
