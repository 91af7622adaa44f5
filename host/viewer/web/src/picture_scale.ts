// Facts about pictures of any time, from readings: length of a pixel at the isocenter, display, view and contents.

const MOST_PARTS = 4000;

/** A length, or the reason why it is not known. */
export type Known = { mm: number } | { reason: string };

/** A value that readings give again and again. */
class Times<Value extends number | string> {
  private readonly parts: { fromS: number; toS: number; value: Value }[] = []; // the newest last

  add(timeS: number, value: Value): void {
    const last = this.parts.at(-1);
    if (last !== undefined && timeS >= last.toS && last.value === value) {
      last.toS = timeS;
      return;
    }
    this.parts.push({ fromS: timeS, toS: timeS, value });
    if (this.parts.length > MOST_PARTS) this.parts.shift();
  }

  clear(): void {
    this.parts.length = 0;
  }

  get newest(): { toS: number; value: Value } | undefined {
    return this.parts.at(-1);
  }

  /** Value at a time: readings before and after it must agree. */
  at(timeS: number): Value | undefined {
    return this.parts.find(({ fromS, toS }) => timeS >= fromS && timeS <= toS)?.value;
  }
}

/** Widths of the field at the isocenter. */
export class FieldTimes {
  private readonly times = new Times<number>();

  add(timeS: number, mm: number): void {
    this.times.add(timeS, mm);
  }

  clear(): void {
    this.times.clear();
  }

  /** Field of a picture. */
  at(timeS: number): Known {
    if (this.times.newest === undefined) return { reason: "the scene gives no field" };
    const mm = this.times.at(timeS);
    return mm === undefined ? { reason: "its field is not known" } : { mm };
  }
}

export const PLAIN = 0;
export const SUBTRACTED = 1;
const CINE = 3;

/** Display of a picture, its view, and things in it that a mask should not have. */
export interface Facts {
  mode: number; // PLAIN, SUBTRACTED, 2 road map
  view: string; // field and table; equal for equal views
  instrument: boolean;
  contrast: boolean;
}

export class FactTimes {
  private readonly times = new Times<string>();

  add(timeS: number, values: Record<string, number | null>): void {
    const mode = values["picture_mode"];
    if (typeof mode !== "number") return;
    const view = ["xray_field_mm", "table_left_mm", "table_head_mm", "table_height_mm"].map((name) => values[name]).join(" ");
    // Cine is a plain picture with less noise.
    const facts: Facts = { mode: mode === CINE ? PLAIN : mode, view, instrument: values["picture_instrument"] === 1, contrast: values["picture_contrast"] === 1 };
    this.times.add(timeS, JSON.stringify(facts));
  }

  clear(): void {
    this.times.clear();
  }

  /** Facts of a picture. The newest ones hold until the next reading. */
  at(timeS: number): Facts | null {
    const { newest } = this.times;
    const facts = newest !== undefined && timeS > newest.toS ? newest.value : this.times.at(timeS);
    return facts === undefined ? null : (JSON.parse(facts) as Facts);
  }
}
