// The way to the server: requests, and the state that it keeps telling.

import type { EditsShown, MistakeShown, NewEdits, NewRemark, NewSignature, NewStable, NewTeaching, OldRemark, ProjectChanges, ProjectShown, RemarksShown, Sighting, State, TeachingShown } from "./api.ts";

/** What the server says of a request that it refuses. */
export class Refused extends Error {
  readonly mistake: MistakeShown;

  constructor(mistake: MistakeShown) {
    super(mistake.message);
    this.mistake = mistake;
  }
}

type Method = "GET" | "POST" | "PATCH" | "DELETE";

async function call<T>(method: Method, path: string, body?: unknown): Promise<T> {
  return (await send(method, path, body)).json() as Promise<T>;
}

async function send(method: Method, path: string, body?: unknown): Promise<Response> {
  const response = await fetch(`/api/v1${path}`, {
    method,
    ...(method === "GET" ? {} : { headers: { "Content-Type": "application/json" }, body: JSON.stringify(body ?? {}) }),
  });
  if (response.ok) return response;
  const mistake = await response.json() as Partial<MistakeShown>;
  throw new Refused({ message: mistake.message ?? response.statusText, line: mistake.line ?? null, way: mistake.way ?? [] });
}

/** The server's calls. */
export const server = {
  schema: () => call<Readonly<Record<string, unknown>>>("GET", "/schema"),
  project: () => call<ProjectShown>("GET", "/project"),
  allow: () => call<State>("POST", "/allow"),
  init: () => call<ProjectShown>("POST", "/project"),
  change: (changes: ProjectChanges) => call<ProjectShown>("PATCH", "/project", changes),
  stable: (area: NewStable) => call<ProjectShown>("POST", "/stable", area),
  start: () => call<State>("POST", "/run"),
  stop: () => call<State>("DELETE", "/run"),
  teaching: () => call<TeachingShown>("GET", "/teaching"),
  teach: (teaching: NewTeaching) => call<State>("POST", "/teaching", teaching),
  accept: () => call<TeachingShown>("POST", "/teaching/accept"),
  decline: () => call<TeachingShown>("DELETE", "/teaching"),
  sightings: (epoch: number, stone: number) => call<readonly Sighting[]>("GET", `/epochs/${epoch}/stones/${stone}`),
  edits: () => call<EditsShown>("GET", "/edits"),
  edit: (edits: NewEdits) => again(() => call<EditsShown>("POST", "/edits", edits)),
  undo: (id: string) => again(() => call<EditsShown>("POST", "/edits/undo", { id })),
  remarks: () => call<RemarksShown>("GET", "/remarks"),
  remark: (said: NewRemark) => call<RemarksShown>("POST", "/remarks", said),
  unremark: (old: OldRemark) => call<RemarksShown>("DELETE", "/remarks", old),
  sign: (signature: NewSignature) => call<RemarksShown>("POST", "/signature", signature),
  unsign: () => call<RemarksShown>("DELETE", "/signature"),
  pdf: async () => (await send("POST", "/pdf")).blob(),
  redo: (id: string) => again(() => call<EditsShown>("POST", "/edits/redo", { id })),
};

/** Sends an act once more where its answer was lost: the server does an act of the same name only once. */
async function again<T>(send: () => Promise<T>): Promise<T> {
  try {
    return await send();
  } catch (error) {
    if (error instanceof Refused) throw error;
    return send();
  }
}

/** A name that no other act has. */
export function newId(): string {
  return crypto.randomUUID();
}

export type Watcher = (state: State) => void;

/** The server's state, passed to all watchers. */
export class Live {
  #state: State | null = null;
  readonly #watchers = new Set<Watcher>();
  readonly #lost: (lost: boolean) => void;

  constructor(lost: (lost: boolean) => void) {
    this.#lost = lost;
    const source = new EventSource("/api/v1/events");
    source.addEventListener("message", (event) => {
      this.#lost(false);
      this.take(JSON.parse(String(event.data)) as State);
    });
    source.addEventListener("error", () => this.#lost(true));
  }

  /** The state that the server sent last. */
  get state(): State | null {
    return this.#state;
  }

  /** Takes a state that came with an answer. */
  take(state: State): void {
    this.#state = state;
    for (const watcher of this.#watchers) watcher(state);
  }

  /** Calls back now, if there is a state, and at every change until the signal ends it. */
  watch(watcher: Watcher, until: AbortSignal): void {
    this.#watchers.add(watcher);
    until.addEventListener("abort", () => this.#watchers.delete(watcher));
    if (this.#state) watcher(this.#state);
  }
}
