// Made from the types of crates/stonewise-studio; a cargo test writes and compares it.

/** `POST /edits/undo` and `POST /edits/redo`. */
export interface Act {
  /** A name that no other act has. */
  readonly id: string;
}

/** What an edit does. */
export type Action = "merge" | "split" | "delete" | "add" | "ignore";

/** A change of the project file. */
export interface Change {
  /** The value; `null` removes it. */
  readonly value: unknown;
  /** The way to the value. */
  readonly way: readonly (Step)[];
}

/** The look at the survey that goes on by itself. */
export interface CheckShown {
  /** Why it could not be done. */
  readonly error?: string | null;
  /** What it found. */
  readonly findings: readonly (FindingShown)[];
  /** Whether it has ended, so that there are findings and a page with pictures (`/check`). */
  readonly is_done: boolean;
  /** Whether it goes on. */
  readonly is_running: boolean;
}

/** One correction by hand. Its shape is in metres on the unrolled wall (along, up), or in pixels of `photo`. */
export interface Edit {
  /** Places in stones. */
  readonly at?: readonly (readonly [number, number])[];
  /** Two opposite corners of a box on the wall; the detector outlines the stone in it. */
  readonly box?: readonly (readonly [number, number])[];
  /** What it does. */
  readonly do: Action;
  /** The epoch of that photo; absent: the first. */
  readonly epoch?: string | null;
  /** The epochs whose stones it changes; absent: all. */
  readonly epochs?: readonly (string)[] | null;
  /** A line from border to border of a stone. */
  readonly line?: readonly (readonly [number, number])[];
  /** A polygon; the first vertex is not repeated. */
  readonly outline?: readonly (readonly [number, number])[];
  /** The photo in whose pixels the shape is given; absent: the unrolled wall. */
  readonly photo?: string | null;
  /** When: a date, YYYY-MM-DD, with a time or without. */
  readonly when: string;
  /** Who decided it. */
  readonly who: string;
  /** Why. */
  readonly why: string;
}

/** `GET /edits`, and the answer to every act: the corrections by hand. */
export interface EditsShown {
  /** Whether there is an undone act. */
  readonly can_redo: boolean;
  /** Whether there is an act to undo. */
  readonly can_undo: boolean;
  /** The edits, as the file of edits holds them. */
  readonly edits: readonly (Edit)[];
}

/** An epoch. */
export interface EpochShown {
  /** Its clouds. */
  readonly clouds: readonly (FileShown)[];
  /** Its date, ISO 8601. */
  readonly date?: string | null;
  /** Whether a picture of it can be shown. */
  readonly has_picture: boolean;
  /** Where its masks are; absent: the detector finds the stones. */
  readonly masks?: string | null;
  /** Its name. */
  readonly name: string;
  /** Number of its photos. */
  readonly photos: number;
}

/** What becomes of a stone. */
export type Fate = "new" | "gone" | "changed";

/** A file of a survey. */
export interface FileShown {
  /** Its length, bytes. */
  readonly bytes: number;
  /** Its path, relative to the project file where it lies beside or below it. */
  readonly name: string;
}

/** A finding of the look at the survey. */
export interface FindingShown {
  /** The epoch; empty where it is about all of them. */
  readonly epoch: string;
  /** What was looked at, in the project's language. */
  readonly text: string;
  /** What it means. */
  readonly weight: Weight;
}

/** What works in the background. */
export type Job = "run" | "teach";

/** Why a request was refused; the body of every error. */
export interface MistakeShown {
  /** The line of the project file. */
  readonly line?: number | null;
  /** What is wrong, and the fix. */
  readonly message: string;
  /** The way to the value that is wrong. */
  readonly way: readonly (Step)[];
}

/** `POST /edits`: edits that are one act and are undone together. */
export interface NewEdits {
  /** The edits; `when` may be empty: now. */
  readonly edits: readonly (Edit)[];
  /** A name that no other act has: an act that is sent again counts once. */
  readonly id: string;
}

/** `POST /remarks`: a remark on a stone, on a zone of deformation, or on the wall. */
export interface NewRemark {
  /** Name of the later epoch whose report prints it; empty: every report. */
  readonly epoch: string;
  /** The stone. */
  readonly stone?: number | null;
  /** What is said. */
  readonly text: string;
  /** Who makes it. */
  readonly who: string;
  /** The zone; with neither, it is about the wall. */
  readonly zone?: number | null;
}

/** `POST /signature`. */
export interface NewSignature {
  /** Where; may be empty. */
  readonly place: string;
  /** Who signs. */
  readonly who: string;
}

/** `POST /stable`: a rectangle on the face whose surface did not move. */
export interface NewStable {
  /** Two opposite corners on the unrolled wall, `[along_m, up_m]`. */
  readonly corners: readonly [readonly [number, number], readonly [number, number]];
  /** How far the area reaches in front of the surface and behind it, metres. */
  readonly margin_m: number;
  /** What people call it; may be empty. */
  readonly name: string;
}

/** `POST /teaching`: trains the detector on the corrections. */
export interface NewTeaching {
  /** Minutes of training in all; those of an interrupted call count. */
  readonly minutes: number;
}

/** A trained detector, its scores, and what it would change. */
export interface Offer {
  /** The trained detector. */
  readonly after: ScoreShown;
  /** The detector that the project uses, on these blocks. */
  readonly before: ScoreShown;
  /** The stones that it would change. */
  readonly changes: readonly (StoneChange)[];
  /** Masks of corrected stones and masks that are none, counted in each photo. */
  readonly corrected: number;
  /** 95 % interval of the change of F1; absent where too few blocks were kept. */
  readonly gain_interval?: readonly [number, number] | null;
  /** Whether the gain is more than chance. */
  readonly is_better: boolean;
  /** Stones in the blocks kept apart. */
  readonly kept: number;
  /** How long it was trained, minutes. */
  readonly minutes: number;
  /** Steps of the training. */
  readonly steps: number;
  /** The folder of its training. */
  readonly training: string;
}

/** `DELETE /remarks`: the remark that was made at this time. */
export interface OldRemark {
  /** When it was made, as the list has it. */
  readonly when: string;
}

/** What the step at work is at. */
export interface PartShown {
  /** Which unit, such as a photo. */
  readonly detail: string;
  /** Units that are done. */
  readonly done: number;
  /** All units; 0 where that is not known. */
  readonly total: number;
  /** What it does, in words. */
  readonly what: string;
}

/** What a run is at. */
export type Phase = "idle" | "running" | "stopping" | "stopped" | "done" | "failed";

/** `PATCH /project`: changes that hold together or not at all. */
export interface ProjectChanges {
  /** The changes, one after the other. */
  readonly changes: readonly (Change)[];
}

/** `GET /project`: the project file. */
export interface ProjectShown {
  /** Its epochs; none where the file is not valid. */
  readonly epochs: readonly (EpochShown)[];
  /** What is wrong with the file. */
  readonly mistake?: MistakeShown | null;
  /** Where there is no file: the file that would be written, and why it is this one. */
  readonly proposal?: ProposalShown | null;
  /** Its stable areas. */
  readonly stable: readonly (StableShown)[];
  /** Its values, as TOML holds them. */
  readonly values: unknown;
}

/** A project file for what lies in the folder. */
export interface ProposalShown {
  /** What was chosen and what was left out, one line each. */
  readonly lines: readonly (string)[];
  /** Its text. */
  readonly text: string;
}

/** A remark. */
export interface RemarkShown {
  /** What it says, and of what. */
  readonly said: NewRemark;
  /** When it was made, ISO 8601. */
  readonly when: string;
}

/** `GET /remarks`, and the answer to every change of them. */
export interface RemarksShown {
  /** In the order in which they were made. */
  readonly remarks: readonly (RemarkShown)[];
  /** Who signed. */
  readonly signature?: SignatureShown | null;
}

/** A run, or a training, as pages show it. */
export interface RunShown {
  /** Why the results as a whole are in doubt, one sentence each. */
  readonly doubts: readonly (string)[];
  /** Why it failed. */
  readonly error?: string | null;
  /** Which of them. */
  readonly job: Job;
  /** The last lines of its log. */
  readonly lines: readonly (string)[];
  /** What the step at work is at. */
  readonly part: PartShown;
  /** What it is at. */
  readonly phase: Phase;
  /** Seconds since it began, until it ended. */
  readonly seconds: number;
  /** The verdict in a sentence, once there is one. */
  readonly sentence?: string | null;
  /** What was left out, such as edits without effect, one sentence each. */
  readonly skipped: readonly (string)[];
  /** Its steps in order. */
  readonly steps: readonly (StepShown)[];
}

/** How well the masks of a detector agree with the stones of the cloud. */
export interface ScoreShown {
  /** Harmonic mean of both. */
  readonly f1?: number | null;
  /** Share of what it found that is right; absent where it found nothing. */
  readonly precision?: number | null;
  /** Share of the stones that it found. */
  readonly recall?: number | null;
}

/** A photo that shows a stone. */
export interface Sighting {
  /** Width of the piece over its height. */
  readonly aspect: number;
  /** The stone's outline in the first epoch, in shares of the width and the height of the piece. */
  readonly outline: readonly (readonly [number, number])[];
  /** File name of the photo. */
  readonly photo: string;
}

/** A signature. */
export interface SignatureShown {
  /** Whether it is under the results as they are now. */
  readonly holds: boolean;
  /** Where. */
  readonly place: string;
  /** When, ISO 8601. */
  readonly when: string;
  /** Who signed. */
  readonly who: string;
}

/** A stable area of the project file. */
export interface StableShown {
  /** The rectangle that it fills on the unrolled wall, two opposite corners, metres; absent without results. */
  readonly corners?: readonly [readonly [number, number], readonly [number, number]] | null;
  /** What people call it; may be empty. */
  readonly name: string;
  /** Its edges along x, y and z of the world, metres. */
  readonly size_m: readonly [number, number, number];
}

/** `GET /state`, and every event of `GET /events`. */
export interface State {
  /** The look at the survey. */
  readonly check: CheckShown;
  /** A run that was started elsewhere and has not finished. */
  readonly elsewhere?: Unfinished | null;
  /** Whether the project file is there. */
  readonly has_project: boolean;
  /** Whether edits or the project changed after the report was written. */
  readonly is_outdated: boolean;
  /** When a trained detector was offered, a number that changes with it; absent where none is. */
  readonly offer?: string | null;
  /** The project file, and the folder of the results. */
  readonly project_file?: string | null;
  /** The number of the project file's version: it changes with every change of the file. */
  readonly project_version: string;
  /** Whether that is so because the project lies outside the folder that was opened; `POST /allow` ends it. */
  readonly read_only: boolean;
  /** When the report was written, a number that changes with it; absent where there is none. */
  readonly report?: string | null;
  /** Where results go. */
  readonly results_folder: string;
  /** The run. */
  readonly run: RunShown;
  /** Whether nothing can be changed. */
  readonly view: boolean;
}

/** A step on it. */
export type Step = string | number;

/** A step of a run. */
export interface StepShown {
  /** What it does, in words. */
  readonly name: string;
  /** How long it has worked, seconds. */
  readonly seconds: number;
  /** What became of it. */
  readonly state: StepState;
}

/** What became of a step. */
export type StepState = "waiting" | "working" | "done" | "earlier";

/** A stone of the first epoch that another detector would change. */
export interface StoneChange {
  /** What becomes of it. */
  readonly fate: Fate;
  /** Its outline on the unrolled wall, `[along_m, up_m]`, to a millimetre: as it would be; of one that is gone as it is. */
  readonly outline: readonly (readonly [number, number])[];
  /** The numbers of the stones as they are now that lie there. */
  readonly stones: readonly (number)[];
}

/** `GET /teaching`, and the answer to what is decided about an offer. */
export interface TeachingShown {
  /** The trained detector that waits for a decision. */
  readonly offer?: Offer | null;
}

/** Results that are not finished: a run in a terminal works on them, or was interrupted. */
export interface Unfinished {
  /** Number of steps whose files are there. */
  readonly finished: number;
  /** The step that finished last, as its folder is named. */
  readonly last_step?: string | null;
  /** What the step at work is at. */
  readonly part: PartShown;
  /** How long ago something was told or finished, seconds. */
  readonly seconds: number;
  /** The steps in order, as the run told them; none where it tells nothing, as units of a plan. */
  readonly steps: readonly (StepShown)[];
}

/** What a finding means for a run. */
export type Weight = "fine" | "note" | "doubt" | "wrong" | "unreadable";
