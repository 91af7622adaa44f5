// Connection to torquer-viewer. It is opened again whenever it is lost.

import { type Incoming, read } from "./frames.js";

const AGAIN_MS = 700;

export class Link {
  private socket: WebSocket | null = null;
  open = false;

  constructor(
    private readonly received: (message: Incoming) => void,
    private readonly changed: (open: boolean) => void,
  ) {
    this.connect();
  }

  /** Returns false without effect while there is no connection. */
  send(message: ArrayBuffer): boolean {
    if (!this.open) return false;
    this.socket?.send(message);
    return true;
  }

  private connect(): void {
    const socket = new WebSocket(new URL("bus", location.href.replace(/^http/, "ws")));
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.open = true;
      this.changed(true);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.received(read(event.data));
    socket.onclose = () => {
      if (this.open) this.changed(false);
      this.open = false;
      setTimeout(() => this.connect(), AGAIN_MS);
    };
    this.socket = socket;
  }
}
