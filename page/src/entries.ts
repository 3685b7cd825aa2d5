// The files of a visit, and what is known of each.

import type { Alike, Answer, Refused } from "./api";
import type { Shown } from "./parsing";

/** What the colours of an explained mesh mean; the service's legend. */
export interface Legend {
  class: string;
  score: number;
  bias: number;
  limit: number;
  colours: string[];
}

export interface Explained {
  glb: Blob;
  legend: Legend;
  shown: Shown;
}

export type State =
  | { step: "sending"; share: number }
  | { step: "waiting" }
  | { step: "done"; answer: Answer }
  | { step: "failed"; error: Refused };

export class Entry {
  state: State = { step: "sending", share: 0 };
  /** null: not read yet, or nothing that the page can draw. */
  shown: Shown | null = null;
  unreadable = false;
  picture: string | null = null;
  explained = new Map<string, Explained>();
  /** The class whose evidence is on the surface, or none. */
  chosen: string | null = null;
  /** The class that was chosen last, whose evidence may be on its way. */
  wanted: string | null = null;
  explainError: Refused | null = null;
  /** Meshes of the library that are like it; null: not asked for. */
  similar: Alike[] | null = null;
  searching = false;
  /** Whether all classes are listed, or only the likeliest. */
  allClasses = false;
  zUp: boolean;

  constructor(
    readonly file: File,
    /** Files that it refers to: the buffers of a glTF. */
    readonly pieces: File[],
    zUp: boolean,
    public model: string,
  ) {
    this.zUp = zUp;
  }

  /** Begin anew, with a model. */
  forget(model: string): void {
    this.model = model;
    this.state = { step: "sending", share: 0 };
    this.explained.clear();
    this.chosen = this.wanted = this.explainError = null;
  }

  /** Why there is no answer, or no explanation. */
  get error(): Refused | null {
    return this.state.step === "failed" ? this.state.error : this.explainError;
  }

  get answer(): Answer | null {
    return this.state.step === "done" ? this.state.answer : null;
  }
}
