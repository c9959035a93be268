// SPDX-License-Identifier: Apache-2.0
// The picture: requests views while the camera moves and when it rests, and shows the newest one.
import { decodePicture } from "./picture.js";

const kMaxUnderWay = 2;    // requests that wait for their pictures: one rendered, one on its way
const kRestAfter = 150;    // ms without motion until the view is refined
const kMaxPixels = 2 ** 24;  // of a picture

export class View {
  /** request(quality, width, height) returns the members of a view message; send(members) its id; compared() what is left and right of the wipe. */
  constructor(stage, canvas, guides, { request, send, compared, shown }) {
    this.stage = stage;
    this.canvas = canvas;
    this.guides = guides;
    this.request = request;
    this.send = send;
    this.compared = compared;
    this.shown = shown;
    this.context = canvas.getContext("2d", { alpha: false });
    this.aspect = 16 / 9;
    this.wanted = null;        // quality of the view that is wanted next
    this.underWay = new Map(); // id -> {quality, input}
    this.newestShown = 0;
    this.next = null;          // decoded picture for the next animation frame
    this.current = null;       // {header, bitmap} that is shown
    this.other = null;         // {header, bitmap} that it is compared with
    this.wipe = 0.5;           // share of the width where the comparison begins
    this.statistics = { shown: [], latency: [] };
    this.input = 0;            // time of the input event that the wanted view answers
    new ResizeObserver(() => this.resize()).observe(stage);
    requestAnimationFrame(() => this.animate());
  }

  /** Fits the picture into its area; its pixels are those of the screen. */
  resize() {
    const ratio = devicePixelRatio;
    const below = this.stage.querySelector("#epi");
    const stageHeight = this.stage.clientHeight - (below.hidden ? 0 : below.offsetHeight);
    const width = Math.min(this.stage.clientWidth, stageHeight * this.aspect);
    if (!(width > 0)) return;
    // The pixels of the screen, as far as the server renders them.
    const fit = Math.min(1, Math.sqrt(kMaxPixels / (width * ratio * width / this.aspect * ratio)));
    this.width = Math.max(1, Math.floor(width * ratio * fit));
    this.height = Math.max(1, Math.floor(width / this.aspect * ratio * fit));
    const style = { left: (this.stage.clientWidth - width) / 2, top: (stageHeight - width / this.aspect) / 2,
      width, height: width / this.aspect };
    for (const canvas of [this.canvas, this.guides]) {
      for (const [name, value] of Object.entries(style)) canvas.style[name] = value + "px";
    }
    this.guides.width = this.width;
    this.guides.height = this.height;
    this.shown?.resized?.();
    this.rest();
  }

  setAspect(aspect) {
    this.aspect = aspect;
    this.resize();
  }

  /** Wants the view of the present camera while it moves. */
  move(inputTime = performance.now()) {
    if (this.wanted !== "moving") this.input = inputTime;
    this.wanted = "moving";
    this.flush();
    clearTimeout(this.restTimer);
    this.restTimer = setTimeout(() => this.rest(), kRestAfter);
  }

  /** Requests a frame of a playing timeline and returns the id of the request. */
  requestPlaying(frame) {
    clearTimeout(this.restTimer);
    this.wanted = null;
    return this.send({ ...this.request("playing"), frame });
  }

  /** Shows a picture of a playing timeline with the next animation frame. */
  showPlaying(header, bitmap) {
    this.newestShown = Math.max(this.newestShown, header.id);
    this.next?.bitmap.close();
    this.next = { header, bitmap };
  }

  /** Wants the refined view. */
  rest() {
    clearTimeout(this.restTimer);
    if (!this.width) return;
    this.wanted = "resting";
    this.flush();
  }

  flush() {
    if (!this.wanted || !this.width) return;
    const quality = this.wanted;
    const fast = [...this.underWay.values()].filter((one) => one.quality !== "resting").length;
    if (quality !== "resting" && fast >= kMaxUnderWay) return;
    const members = this.request(quality, this.width, this.height);
    if (!members) return;
    this.wanted = null;
    const id = this.send(members);
    this.underWay.set(id, { quality, input: this.input });
    if (members.comparison) this.labels = { id, texts: this.compared() };
  }

  /** Handles a picture of the server: of the view, or what it is compared with. */
  async receive(header, jpeg) {
    const bitmap = await decodePicture(jpeg);
    // The server answers only the newest request: older ones will not be answered any more.
    const under = this.underWay.get(header.id);
    for (const id of this.underWay.keys()) {
      if (id < header.id || (id === header.id && header.final)) this.underWay.delete(id);
    }
    this.flush();
    if (header.id < this.newestShown) return bitmap.close();
    this.newestShown = header.id;
    if (header.content === "comparison") {
      this.other?.bitmap.close();
      this.other = { header, bitmap };
      this.needsDrawing = true;
      return;
    }
    this.next?.bitmap.close();
    this.next = { header, bitmap, input: under?.input };
  }

  /** A request that failed is not under way any more. */
  failed(id) {
    this.underWay.delete(id);
    this.flush();
  }

  animate() {
    requestAnimationFrame(() => this.animate());
    if (this.next) {
      const { header, bitmap, input } = this.next;
      this.next = null;
      this.current?.bitmap.close();
      this.current = { header, bitmap };
      this.draw();
      this.record(header, performance.now(), input);
      this.shown.picture(header);
    } else if (this.needsDrawing && this.current) {
      this.draw();
    }
  }

  /** Draws the picture, and right of the wipe what it is compared with. */
  draw() {
    this.needsDrawing = false;
    const { header, bitmap } = this.current;
    if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
      this.canvas.width = bitmap.width;
      this.canvas.height = bitmap.height;
    }
    this.context.drawImage(bitmap.source, 0, 0);
    if (!this.isCompared()) return;
    const { width, height } = bitmap, left = Math.round(this.wipe * width), other = this.other.bitmap;
    const scale = other.width / width;
    if (left < width) {
      this.context.drawImage(other.source, left * scale, 0, other.width - left * scale, other.height, left, 0, width - left, height);
    }
    this.context.fillStyle = "#f0b429";
    this.context.fillRect(left - 1, 0, 2, height);
    this.drawCompared(left);
  }

  /** Names what is left and right of the wipe. */
  drawCompared(left) {
    const context = this.context, size = Math.max(12, Math.round(this.canvas.width / 60));
    context.font = `${size}px system-ui`;
    context.textBaseline = "top";
    const { id, texts } = this.labels ?? {};
    if (id !== this.current.header.id) return;  // of settings that are not shown yet
    // While a method estimates depths, another one's picture is shown.
    [this.current.header.method || texts[0], texts[1]].forEach((text, i) => {
      const width = context.measureText(text).width, x = i === 0 ? left - width - size : left + size;
      context.fillStyle = "#000a";
      context.fillRect(x - size / 2, size / 2, width + size, 1.5 * size);
      context.fillStyle = "#dcdde0";
      context.fillText(text, x, 0.75 * size);
    });
  }

  /** Whether what the shown view is compared with is shown, too. Views that move are not compared. */
  isCompared() { return Boolean(this.other && this.current && this.other.header.id === this.current.header.id); }

  setWipe(share) {
    this.wipe = Math.min(1, Math.max(0, share));
    this.needsDrawing = true;
  }

  record(header, now, input) {
    const { shown, latency } = this.statistics;
    shown.push(now);
    if (header.quality === "moving" && input) latency.push(now - input);
    for (const list of [shown, latency]) if (list.length > 5000) list.splice(0, 1000);
  }

  /** Returns the pixel of the picture under a pointer event, as the server counts them. */
  pixelAt(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * this.width;
    const y = (event.clientY - box.top) / box.height * this.height;
    return [Math.min(this.width - 1, Math.max(0, x)), Math.min(this.height - 1, Math.max(0, y))];
  }
}

/** Draws the guides of a kind over the picture. `overscan`: pixels of the shot, [x, y]. */
export function drawGuides(canvas, kind, shot) {
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.strokeStyle = "#fff9";
  context.lineWidth = Math.max(1, canvas.width / 1200);
  const rectangle = (share) => context.strokeRect(canvas.width * (1 - share) / 2, canvas.height * (1 - share) / 2,
    canvas.width * share, canvas.height * share);
  if (kind === "safe") {
    for (const share of [0.93, 0.9]) rectangle(share);  // SMPTE ST 2046-1: action, title
  } else if (kind === "thirds") {
    context.beginPath();
    for (const share of [1 / 3, 2 / 3]) {
      context.moveTo(canvas.width * share, 0);
      context.lineTo(canvas.width * share, canvas.height);
      context.moveTo(0, canvas.height * share);
      context.lineTo(canvas.width, canvas.height * share);
    }
    context.stroke();
  } else if (Number(kind) > 0) {
    // What a picture of this aspect ratio does not show is darker.
    const width = Math.min(canvas.width, canvas.height * kind), height = Math.min(canvas.height, canvas.width / kind);
    const x = (canvas.width - width) / 2, y = (canvas.height - height) / 2;
    context.fillStyle = "#000a";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.clearRect(x, y, width, height);
    context.strokeRect(x, y, width, height);
  } else if (kind === "overscan" && shot) {
    // The shot renders more than the picture: corners show how much.
    const x = shot.overscan[0] / shot.width * canvas.width, y = shot.overscan[1] / shot.height * canvas.height;
    context.setLineDash([8, 6]);
    context.strokeRect(x, y, canvas.width - 2 * x, canvas.height - 2 * y);
    context.setLineDash([]);
  }
}
