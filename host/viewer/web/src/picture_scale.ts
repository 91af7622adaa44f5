// Length of a pixel at the isocenter, for pictures of any time.

const MOST_PARTS = 4000;

/** A length, or the reason why it is not known. */
export type Known = { mm: number } | { reason: string };

/** Widths of the field at the isocenter, from readings. */
export class FieldTimes {
  private readonly parts: { fromS: number; toS: number; mm: number }[] = []; // the newest last

  add(timeS: number, mm: number): void {
    const last = this.parts.at(-1);
    if (last !== undefined && timeS >= last.toS && last.mm === mm) {
      last.toS = timeS;
      return;
    }
    this.parts.push({ fromS: timeS, toS: timeS, mm });
    if (this.parts.length > MOST_PARTS) this.parts.shift();
  }

  clear(): void {
    this.parts.length = 0;
  }

  /** Field of a picture: readings before and after it must agree. */
  at(timeS: number): Known {
    if (this.parts.length === 0) return { reason: "the scene gives no field" };
    for (const { fromS, toS, mm } of this.parts) {
      if (timeS >= fromS && timeS <= toS) return { mm };
    }
    return { reason: "its field is not known" };
  }
}
