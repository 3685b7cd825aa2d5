// The API key, where the service asks for one: kept for this tab alone, and sent with every request.

import type { Refused } from "./api";
import { byId } from "./dom";

const NAME = "meshconv3d-key";
// What a header can carry.
const POSSIBLE = /^[!-~]+$/;

export function keyHeaders(): Record<string, string> {
  const key = sessionStorage.getItem(NAME);
  return key ? { "x-api-key": key } : {};
}

/** Where a key is asked for. `given` hears that there is another one. */
export class KeyForm {
  private readonly form = byId<HTMLFormElement>("key");
  private readonly field = byId<HTMLInputElement>("key-field");

  constructor(private readonly given: () => void) {
    this.form.onsubmit = (event) => {
      event.preventDefault();
      this.take(this.field.value.trim());
    };
  }

  /** Ask for a key, because the service refused the one that it was shown, or none. */
  ask(refused: Refused): void {
    this.tell(`${refused.title}. ${refused.message}`);
    if (!this.form.hidden) return;
    this.form.hidden = false;
    this.field.focus();
  }

  private take(key: string): void {
    if (!POSSIBLE.test(key)) {
      this.tell("This is no key: keys are letters, digits and signs, without blanks.");
      return;
    }
    sessionStorage.setItem(NAME, key);
    this.form.hidden = true;
    this.field.value = "";
    this.given();
  }

  private tell(words: string): void {
    byId("key-reason").textContent = words;
  }
}
