// A canvas that shows gray pictures with a window and a level.

import type { Picture } from "./frames.js";
import type { Gray } from "./vessel_course.js";

/** Grays to show in place of a picture's own; the same array to leave them. */
export type Filter = (raw: Gray, picture: Picture) => Uint8ClampedArray;

export class PictureCanvas {
  private readonly screen: CanvasRenderingContext2D;
  private filter: Filter = ({ value }) => value;
  private own = new Uint8ClampedArray(); // grays of the picture
  private values = this.own; // after the filter
  private drawn: Picture | null = null;
  private decoding = false;
  private waiting: Picture | null = null;
  private level = 128; // gray that is shown as the middle
  private width = 256; // grays from black to white

  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly resized: () => void,
    private readonly unreadable: () => void,
    private readonly changed: () => void = () => {},
  ) {
    this.screen = canvas.getContext("2d", { willReadFrequently: true })!;
  }

  /** Picture on the canvas. */
  get picture(): Picture | null {
    return this.drawn;
  }

  /** Its grays before the filter. */
  get raw(): Gray {
    return { ...this.gray, value: this.own };
  }

  /** Its grays after the filter, before window and level. */
  get gray(): Gray {
    return { width: this.canvas.width, height: this.canvas.height, value: this.values };
  }

  /** While the decoder is busy, the newest picture waits and older ones are dropped. */
  show(picture: Picture): void {
    this.waiting = picture;
    if (!this.decoding) void this.decode();
  }

  setFilter(filter: Filter): void {
    this.filter = filter;
    this.filterAgain();
  }

  filterAgain(): void {
    if (this.drawn === null) return;
    this.values = this.filter(this.raw, this.drawn);
    this.paint();
  }

  setWindow(level: number, width: number): void {
    this.level = level;
    this.width = width;
    this.paint();
  }

  clear(): void {
    this.waiting = null;
    this.values = this.own = new Uint8ClampedArray();
    this.drawn = null;
    this.screen.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  private async decode(): Promise<void> {
    this.decoding = true;
    while (this.waiting !== null) {
      const picture = this.waiting;
      this.waiting = null;
      try {
        const image = await createImageBitmap(new Blob([picture.jpeg], { type: "image/jpeg" }));
        this.take(image, picture);
        image.close();
        this.drawn = picture;
        this.changed();
      } catch {
        this.unreadable();
      }
    }
    this.decoding = false;
  }

  private take(image: ImageBitmap, picture: Picture): void {
    const resized = this.canvas.width !== image.width || this.canvas.height !== image.height;
    if (resized) {
      this.canvas.width = image.width;
      this.canvas.height = image.height;
    }
    this.screen.drawImage(image, 0, 0);
    const pixels = this.screen.getImageData(0, 0, image.width, image.height).data;
    if (this.own.length !== pixels.length / 4) this.own = new Uint8ClampedArray(pixels.length / 4);
    for (let i = 0; i < this.own.length; ++i) this.own[i] = pixels[4 * i]!;
    this.values = this.filter(this.raw, picture);
    if (this.level !== 128 || this.width !== 256 || this.values !== this.own) this.paint();
    if (resized) this.resized();
  }

  private paint(): void {
    if (this.values.length === 0) return;
    const shown = new Uint8ClampedArray(256);
    for (let value = 0; value < 256; ++value) {
      shown[value] = 128 + ((value - this.level) * 256) / this.width;
    }
    const image = this.screen.createImageData(this.canvas.width, this.canvas.height);
    for (let i = 0; i < this.values.length; ++i) {
      const value = shown[this.values[i]!]!;
      image.data[4 * i] = image.data[4 * i + 1] = image.data[4 * i + 2] = value;
      image.data[4 * i + 3] = 255;
    }
    this.screen.putImageData(image, 0, 0);
  }
}
