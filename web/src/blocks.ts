// Packed columns: base64 (RFC 4648) of gzip (RFC 1952) of little-endian integers times a unit. Written by `page/block.rs`.

/** Where a column lies in its block and how its integers become numbers. */
export interface ColumnEntry {
  readonly name: string;
  readonly type: "i8" | "i16" | "i32" | "u8" | "u16" | "u32";
  readonly unit: number;
  /** First byte. */
  readonly start: number;
  /** Number of values. */
  readonly length: number;
}

/** The columns of an unpacked block. */
export class Columns {
  readonly #entries: ReadonlyMap<string, ColumnEntry>;
  readonly #bytes: ArrayBuffer;

  constructor(entries: readonly ColumnEntry[], bytes: ArrayBuffer) {
    this.#entries = new Map(entries.map((entry) => [entry.name, entry]));
    this.#bytes = bytes;
  }

  /** Numbers in their unit; NaN where there is no value. */
  numbers(name: string): Float64Array {
    const entry = this.#entry(name);
    const whole = this.#integers(entry);
    const none = { i8: -128, i16: -32768, i32: -2147483648 }[entry.type as string];
    const out = new Float64Array(entry.length);
    for (let i = 0; i < whole.length; i++) out[i] = whole[i] === none ? NaN : whole[i]! * entry.unit;
    return out;
  }

  /** The integers as they are; for columns whose unit is one. */
  integers(name: string): Int8Array | Int16Array | Int32Array | Uint8Array | Uint16Array | Uint32Array {
    return this.#integers(this.#entry(name));
  }

  #entry(name: string): ColumnEntry {
    const entry = this.#entries.get(name);
    if (!entry) throw new Error(`the report holds no column ${name}`);
    return entry;
  }

  #integers({ type, start, length }: ColumnEntry) {
    switch (type) {
      case "i8": return new Int8Array(this.#bytes, start, length);
      case "i16": return new Int16Array(this.#bytes, start, length);
      case "i32": return new Int32Array(this.#bytes, start, length);
      case "u8": return new Uint8Array(this.#bytes, start, length);
      case "u16": return new Uint16Array(this.#bytes, start, length);
      case "u32": return new Uint32Array(this.#bytes, start, length);
    }
  }
}

/** Bytes of a base64 text. */
export function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** Unpacks a block. */
export async function unpack(entries: readonly ColumnEntry[], text: string): Promise<Columns> {
  const stream = new Blob([fromBase64(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Columns(entries, await new Response(stream).arrayBuffer());
}
