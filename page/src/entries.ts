// The files of a visit, and what is known of each.

import type { Alike, Answer, Refused } from "./api";
import type { Shown } from "./parsing";

/** What the colours of an explained mesh mean; a legend. */
export interface Legend {
  file: string | null;
  class: string;
  score: number;
  bias: number;
  limit: number;
  colours: string[];
  model: Answer["model"];
}

export interface Explained {
  glb: Blob;
  legend: Legend;
  shown: Shown;
}

export type State =
  | { step: "sending"; share: number; bytes: number }
  | { step: "waiting" }
  | { step: "done"; answer: Answer }
  | { step: "failed"; error: Refused };

export class Entry {
  state: State = { step: "waiting" };
  /** null: not read yet, or nothing that the page can draw. */
  shown: Shown | null = null;
  unreadable = false;
  /** Whether the third axis is up, and not the second. */
  zUp = false;
  picture: string | null = null;
  explained = new Map<string, Explained>();
  /** The class that was chosen to be explained; null: the likeliest. */
  chosen: string | null = null;
  /** Ends the explanation that is being computed. */
  explaining: AbortController | null = null;
  explainError: Refused | null = null;
  /** The answer of another model that is surer; undefined: the others were not asked. */
  surer: Answer | null | undefined = undefined;
  /** Meshes of the library that are like it; null: not asked for. */
  similar: Alike[] | null = null;
  searching = false;
  searchError: Refused | null = null;
  /** Whether all classes are listed, or only the likeliest. */
  allClasses = false;

  constructor(
    readonly file: File,
    /** Files that it refers to: the buffers of a glTF. */
    readonly pieces: File[],
    public model: string,
  ) {}

  /** Begin anew, with a model. */
  forget(model: string): void {
    this.model = model;
    this.state = { step: "waiting" };
    this.explaining?.abort();
    this.explained.clear();
    this.chosen = this.explainError = this.searchError = null;
    this.surer = undefined;
  }

  /** Why there is no answer, no explanation, or no search. */
  get error(): Refused | null {
    return this.state.step === "failed" ? this.state.error : (this.explainError ?? this.searchError);
  }

  get answer(): Answer | null {
    return this.state.step === "done" ? this.state.answer : null;
  }

  get files(): File[] {
    return [this.file, ...this.pieces];
  }

  /** The class that is explained. */
  get label(): string {
    return this.chosen ?? this.answer!.class;
  }
}
