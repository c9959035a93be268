// SPDX-License-Identifier: Apache-2.0
// The WebSocket to the server: see docs/formats/viewer.md.

const kSchema = "raystage/viewer_message/1";
const kRetryAfter = 2000;  // ms from the loss of a connection
const kLost = "The connection to the server is lost.";
/** The error of a question that the server did not answer. */
export const kReplaced = "A newer request replaced this one.";

/** Sends messages and receives answers, texts and pictures. */
export class Connection {
  /** handlers: {open(), close(), message(json), picture(header, jpeg bytes)}. */
  constructor(handlers) {
    this.handlers = handlers;
    this.nextId = 1;
    this.waiting = new Map();  // id of a question -> {type, resolve, reject}
    // Afterwards, because the page that handles messages is not complete yet.
    queueMicrotask(() => this.connect(firstSocket));
  }

  /** early: {socket, received, isClosed}, a socket that was opened before; null: opens one. */
  connect(early = null) {
    this.socket = early?.socket ?? openSocket();
    this.socket.onopen = () => this.handlers.open();
    this.socket.onclose = () => {
      for (const { reject } of this.waiting.values()) reject(new Error(kLost));
      this.waiting.clear();
      this.handlers.close();
      setTimeout(() => this.connect(), kRetryAfter);
    };
    this.socket.onmessage = (event) => this.receive(event.data);
    if (!early) return;
    if (this.socket.readyState === WebSocket.OPEN) this.handlers.open();
    for (const data of early.received.splice(0)) this.socket.dispatchEvent(new MessageEvent("message", { data }));
    if (early.isClosed) this.socket.onclose();
  }

  /** Sends a message and returns its id. */
  send(type, members) {
    const id = this.nextId++;
    if (this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify({ schema: kSchema, type, id, ...members }));
    }
    return id;
  }

  /** Sends a message; the promise is the answer with its id: a message, or {header, jpeg}. */
  ask(type, members) {
    if (this.socket?.readyState !== WebSocket.OPEN) return Promise.reject(new Error(kLost));
    const id = this.send(type, members);
    return new Promise((resolve, reject) => this.waiting.set(id, { type, resolve, reject }));
  }

  receive(data) {
    if (typeof data !== "string") {
      const length = new DataView(data).getUint32(0, true);
      const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      const jpeg = new Uint8Array(data, 4 + length);
      const question = this.waiting.get(header.id);
      if (question?.type === header.content) {
        this.waiting.delete(header.id);
        question.resolve({ header, jpeg });
      }
      // Of pictures that wait for a slow connection the server sends only the newest one.
      for (const [id, older] of this.waiting) {
        if (id >= header.id || older.type !== header.content || header.content === "thumbnail") continue;
        this.waiting.delete(id);
        older.reject(new Error(kReplaced));
      }
      this.handlers.picture(header, jpeg);
      return;
    }
    const message = JSON.parse(data);
    const question = this.waiting.get(message.id);
    if (question) {
      this.waiting.delete(message.id);
      if (message.type === "error") {
        question.reject(new Error(errorText(message)));
      } else if (message.type === "dropped") {
        question.reject(new Error(kReplaced));
      } else {
        question.resolve(message);
      }
    }
    this.handlers.message(message);
  }
}

/** Returns "where: what. Advice." of an error message. */
export function errorText(message) {
  return (message.where ? message.where + ": " : "") + message.what + (message.advice ? ". " + message.advice + "." : "");
}
