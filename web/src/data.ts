// The report's data: the document that the page carries and its blocks of columns.

import { type ColumnEntry, type Columns, unpack } from "./blocks.ts";

/** What a stone's status means. */
export interface Status {
  readonly word: string;
  readonly meaning: string;
}

/** A camera of an epoch, in the page's world coordinates, metres. */
export interface CameraEntry {
  readonly epoch: number;
  readonly name: string;
  readonly centre: readonly [number, number, number];
  /** View axis, then the image's right and down axes, each scaled to the picture's edge at one metre. */
  readonly axis: readonly [number, number, number];
  readonly right: readonly [number, number, number];
  readonly down: readonly [number, number, number];
}

/** Where the photo crops lie. */
export interface CropDocument {
  /** Edge of a crop, pixels, and crops in a row of an atlas. */
  readonly side: number;
  readonly perRow: number;
  /** Names of the photos. */
  readonly photos: readonly string[];
  /** Number of atlas pictures, which are elements `crops-EPOCH-NUMBER`. */
  readonly atlases: number;
}

/** Where the pictures of stones tracked in photos lie: three a stone, as the stones with pictures come. */
export interface TrackDocument {
  /** Edge of a picture, pixels, and pictures in a row of an atlas. */
  readonly side: number;
  readonly perRow: number;
  /** Names of the photos. */
  readonly photos: readonly string[];
}

/** The JSON document of the page; `page/explorer.rs` writes it. */
export interface ReportDocument {
  readonly epochs: readonly [string, string];
  readonly statuses: readonly Status[];
  readonly colours: { readonly diverging: readonly string[]; readonly sequential: readonly string[] };
  /** Ends of the scales, millimetres, milliradians. */
  readonly limits: {
    readonly component: number;
    readonly norm: number;
    readonly relative: number;
    readonly limit: number;
    readonly rotation: number;
    readonly opening: number;
  };
  /** Whether the results as a whole can be relied on. If not, it is unknown which stones moved or are loose, and there are no limits and intervals. */
  readonly sound: boolean;
  /** Whether uncertainties hold the error of the registration of the epochs. */
  readonly registrationKnown: boolean;
  /** The terms of the standard deviations, in words. */
  readonly terms: readonly string[];
  /** Known in-plane translation (along, up), millimetres. */
  readonly truth: readonly [number, number] | null;
  readonly blocks: Readonly<Record<string, readonly ColumnEntry[]>>;
  readonly cameras: readonly CameraEntry[];
  readonly crops: readonly [CropDocument | null, CropDocument | null];
  readonly tracks: TrackDocument | null;
}

/** Components in the order along, up, out. */
export type Three<T> = readonly [T, T, T];

/** All stones, one entry each. Lengths metres, angles radians; NaN where nothing was measured. */
export interface Stones {
  readonly count: number;
  readonly id: ArrayLike<number>;
  readonly state: ArrayLike<number>;
  /** Partner in the later epoch, 0 for none. */
  readonly partner: ArrayLike<number>;
  readonly area: Float64Array;
  readonly points: readonly [ArrayLike<number>, ArrayLike<number>];
  readonly photos: ArrayLike<number>;
  readonly confidence: Float64Array;
  readonly move: Three<Float64Array>;
  readonly relative: Three<Float64Array>;
  readonly rotation: Three<Float64Array>;
  readonly sigma: Three<Float64Array>;
  /** What each term of the document adds to `sigma`, as a standard deviation: squares add up. */
  readonly budget: readonly Three<Float64Array>[];
  /** Correlations along-up, along-out, up-out. */
  readonly correlation: Three<Float64Array>;
  readonly limit: Float64Array;
  readonly observability: Float64Array;
  /** Above its own 95 % limit. */
  readonly significant: ArrayLike<number>;
  /** Moved, with the false discovery rate over all stones controlled. */
  readonly moved: ArrayLike<number>;
  readonly loose: ArrayLike<number>;
  /** Median M3C2 distance of the core points on the stone. */
  readonly m3c2: Float64Array;
  /** Place on the unrolled wall. */
  readonly a: Float64Array;
  readonly u: Float64Array;
  /** World position about the page's origin, and outward normal of the face. */
  readonly position: Three<Float64Array>;
  readonly normal: Three<Float64Array>;
  /** Vertices of stone i: `ring[2 * k]`, `ring[2 * k + 1]` for k from `ringEnd[i - 1]` to `ringEnd[i]`, from its place. */
  readonly ring: Float64Array;
  readonly ringEnd: ArrayLike<number>;
}

/** Joints between neighbouring stones; metres. */
export interface Joints {
  readonly count: number;
  readonly first: ArrayLike<number>;
  readonly second: ArrayLike<number>;
  readonly ends: readonly [Float64Array, Float64Array, Float64Array, Float64Array];
  /** Its two ends in the world. */
  readonly world: readonly [Three<Float64Array>, Three<Float64Array>];
  readonly width: Float64Array;
  readonly opening: Float64Array;
  readonly sliding: Float64Array;
  readonly step: Float64Array;
  /** Standard deviation of the opening. */
  readonly sigma: Float64Array;
}

/** M3C2 core points on the unrolled wall; metres. */
export interface Change {
  readonly a: Float64Array;
  readonly u: Float64Array;
  readonly distance: Float64Array;
  readonly limit: Float64Array;
}

/** Everything the views draw from. */
export interface Report {
  readonly document: ReportDocument;
  readonly stones: Stones;
  readonly joints: Joints;
  readonly change: Change;
  readonly indexOfId: ReadonlyMap<number, number>;
  /** Unpacks one of the larger blocks, once; `null` where the report has none. */
  readonly block: (name: string) => Promise<Columns | null>;
}

/** Reads the report out of its page; `null` where the page carries no data. */
export async function readReport(page: Document): Promise<Report | null> {
  const text = page.getElementById("report-data")?.textContent;
  if (!text) return null;
  const document = JSON.parse(text) as ReportDocument;
  const opened = new Map<string, Promise<Columns | null>>();
  const block = (name: string): Promise<Columns | null> => {
    let columns = opened.get(name);
    if (!columns) {
      const entries = document.blocks[name];
      const element = page.getElementById(`block-${name}`);
      columns = entries && element ? unpack(entries, element.textContent ?? "") : Promise.resolve(null);
      // The text is not used again: its memory is freed.
      element?.remove();
      opened.set(name, columns);
    }
    return columns;
  };
  const [stones, joints, change] = await Promise.all([block("stones"), block("joints"), block("change")]);
  if (!stones || !joints || !change) return null;
  const all = readStones(stones, document.terms.length);
  const indexOfId = new Map(Array.from({ length: all.count }, (_, i) => [all.id[i]!, i]));
  return { document, stones: all, joints: readJoints(joints), change: readChange(change), indexOfId, block };
}

function readStones(columns: Columns, terms: number): Stones {
  const numbers = (name: string) => columns.numbers(name);
  const three = (stem: string): Three<Float64Array> => [numbers(`${stem}Along`), numbers(`${stem}Up`), numbers(`${stem}Out`)];
  const id = columns.integers("id");
  return {
    count: id.length,
    id,
    state: columns.integers("state"),
    partner: columns.integers("partner"),
    area: numbers("area"),
    points: [columns.integers("points1"), columns.integers("points2")],
    photos: columns.integers("photos"),
    confidence: numbers("confidence"),
    move: three("d"),
    relative: three("rel"),
    rotation: three("rot"),
    sigma: three("sigma"),
    budget: Array.from({ length: terms }, (_, n) => three(`term${n}`)),
    correlation: [numbers("corAlongUp"), numbers("corAlongOut"), numbers("corUpOut")],
    limit: numbers("limit"),
    observability: numbers("observability"),
    significant: columns.integers("significant"),
    moved: columns.integers("moved"),
    loose: columns.integers("loose"),
    m3c2: numbers("m3c2"),
    a: numbers("a"),
    u: numbers("u"),
    position: [numbers("x"), numbers("y"), numbers("z")],
    normal: [numbers("nx"), numbers("ny"), numbers("nz")],
    ring: numbers("ring"),
    ringEnd: columns.integers("ringEnd"),
  };
}

function readJoints(columns: Columns): Joints {
  const first = columns.integers("first");
  const world = (end: 1 | 2): Three<Float64Array> => [columns.numbers(`x${end}`), columns.numbers(`y${end}`), columns.numbers(`z${end}`)];
  return {
    count: first.length,
    first,
    second: columns.integers("second"),
    ends: [columns.numbers("a1"), columns.numbers("u1"), columns.numbers("a2"), columns.numbers("u2")],
    world: [world(1), world(2)],
    width: columns.numbers("width"),
    opening: columns.numbers("opening"),
    sliding: columns.numbers("sliding"),
    step: columns.numbers("step"),
    sigma: columns.numbers("sigma"),
  };
}

function readChange(columns: Columns): Change {
  const [a, u, distance, limit] = ["a", "u", "distance", "limit"].map((name) => columns.numbers(name));
  return { a: a!, u: u!, distance: distance!, limit: limit! };
}

/** Whether a stone has a measured motion. */
export function isMeasured(stones: Stones, i: number): boolean {
  return !Number.isNaN(stones.move[2][i]!);
}

/** Length of the displacement, metres. */
export function norm(vector: Three<Float64Array>, i: number): number {
  return Math.hypot(vector[0][i]!, vector[1][i]!, vector[2][i]!);
}

/** Vertices of a stone on the unrolled wall: along, up, along, up, ... in metres. */
export function ringOf(stones: Stones, i: number): Float64Array {
  const from = i === 0 ? 0 : stones.ringEnd[i - 1]!;
  const ring = stones.ring.slice(2 * from, 2 * stones.ringEnd[i]!);
  for (let k = 0; k < ring.length; k += 2) {
    ring[k]! += stones.a[i]!;
    ring[k + 1]! += stones.u[i]!;
  }
  return ring;
}

/** Covariance of the displacement in the face frame, m^2, row by row. */
export function covariance(stones: Stones, i: number): number[][] {
  const [a, u, o] = stones.sigma.map((s) => s[i]!) as [number, number, number];
  const [au, ao, uo] = stones.correlation.map((c) => c[i]!) as [number, number, number];
  return [
    [a * a, au * a * u, ao * a * o],
    [au * a * u, u * u, uo * u * o],
    [ao * a * o, uo * u * o, o * o],
  ];
}
