// SPDX-License-Identifier: Apache-2.0
// The timeline: frames, keys, in and out, notes.

export class Timeline {
  /** changed(frame, quality): shows a frame, "playing" or "moving". moveKey(from, to). keys(), timeKeys(), notes(): frames. playback: a Playback. */
  constructor(canvas, { changed, moveKey, keys, timeKeys, notes, playback }) {
    this.canvas = canvas;
    this.changed = changed;
    this.moveKey = moveKey;
    this.keys = keys;
    this.timeKeys = timeKeys;
    this.notes = notes;
    this.playback = playback;
    this.absences = [];  // [frame, cameras without a frame; -1: all]
    this.first = 1;
    this.last = 1;
    this.in = 1;
    this.out = 1;
    this.frame = 1;
    this.fps = 24;
    this.speed = 1;
    this.loop = true;
    this.playing = false;
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => this.pointerDown(event));
    canvas.addEventListener("pointermove", (event) => this.pointerMove(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => this.pointerUp());
  }

  reset(first, last, fps) {
    const isSame = first === this.first && last === this.last;
    this.first = first;
    this.last = last;
    this.fps = fps;
    if (!isSame) {
      this.in = first;
      this.out = last;
    }
    this.frame = Math.min(last, Math.max(first, this.frame));
    this.draw();
  }

  go(frame, quality = "moving") {
    const next = Math.min(this.last, Math.max(this.first, Math.round(frame)));
    if (next === this.frame) return;
    this.frame = next;
    if (this.playing && quality !== "playing") this.playback.begin(Math.min(this.out, Math.max(this.in, next)));
    this.draw();
    this.changed(next, quality);
  }

  /** Starts or stops playing. */
  toggle() {
    if (this.playing) return this.stop();
    if (this.in === this.out) return;
    this.playing = true;
    const isAtEnd = this.speed > 0 ? this.frame >= this.out : this.frame <= this.in;
    if (isAtEnd || this.frame < this.in || this.frame > this.out) this.frame = this.speed > 0 ? this.in : this.out;
    this.playback.start(this.frame, () => ({ first: this.in, last: this.out, fps: this.fps, speed: this.speed, loop: this.loop }));
  }

  stop() {
    this.playing = false;
    this.playback.stop();
    this.changed(this.frame, "resting");
  }

  setSpeed(speed) {
    this.speed = speed;
    if (this.playing) this.playback.begin(this.frame);
  }

  x(frame) {
    const margin = 14, width = this.canvas.clientWidth - 2 * margin;
    return margin + (this.last > this.first ? (frame - this.first) / (this.last - this.first) : 0.5) * width;
  }
  frameAt(event) {
    const margin = 14, box = this.canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - margin) / (box.width - 2 * margin);
    return Math.round(this.first + Math.min(1, Math.max(0, share)) * (this.last - this.first));
  }

  pointerDown(event) {
    this.canvas.setPointerCapture(event.pointerId);
    const box = this.canvas.getBoundingClientRect();
    const isOnKeys = event.clientY - box.top > box.height / 2;
    const frame = this.frameAt(event);
    this.dragged = isOnKeys ? this.keys().find((key) => Math.abs(this.x(key) - (event.clientX - box.left)) < 8) : undefined;
    this.dragging = true;
    this.hasMoved = false;
    if (this.dragged === undefined) this.go(frame);
  }
  pointerMove(event) {
    if (!this.dragging) return;
    if (this.dragged === undefined) return this.go(this.frameAt(event));
    const to = this.frameAt(event);
    if (to === this.dragged || !this.moveKey(this.dragged, to, this.hasMoved)) return;
    this.dragged = to;
    this.hasMoved = true;  // one step to undo
  }
  pointerUp() {
    this.dragging = false;
    this.dragged = undefined;
  }

  draw() {
    const ratio = devicePixelRatio, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.fillStyle = "#2b2e33";
    context.fillRect(this.x(this.first), 14, this.x(this.last) - this.x(this.first), 6);
    context.fillStyle = "#4b6a8f";
    context.fillRect(this.x(this.in), 14, this.x(this.out) - this.x(this.in), 6);
    const perFrame = Math.max(1.5, (this.x(this.last) - this.x(this.first)) / Math.max(1, this.last - this.first));
    for (const [frame, absent] of this.absences) {
      context.fillStyle = absent < 0 ? "#d4493f" : "#c98a2b";
      context.fillRect(this.x(frame) - perFrame / 2, 20, perFrame, 4);
    }
    context.fillStyle = "#9a9da3";
    context.font = "10px system-ui";
    context.textAlign = "center";
    const labels = Math.max(1, Math.floor(width / 80));
    const step = Math.max(1, Math.ceil((this.last - this.first) / labels));
    for (let frame = this.first; frame <= this.last; frame += step) {
      context.fillRect(this.x(frame), 10, 1, 4);
      context.fillText(frame, this.x(frame), 9);
    }
    for (const key of this.keys()) {
      const x = this.x(key), y = 32;
      context.fillStyle = key === this.frame ? "#f0b429" : "#dcdde0";
      context.beginPath();
      context.moveTo(x, y - 6);
      context.lineTo(x + 6, y);
      context.lineTo(x, y + 6);
      context.lineTo(x - 6, y);
      context.fill();
    }
    context.fillStyle = "#7fc97f";
    for (const frame of this.timeKeys()) context.fillRect(this.x(frame) - 3, 38, 6, 6);
    context.fillStyle = "#6ea3dc";
    for (const frame of this.notes()) {
      context.beginPath();
      context.arc(this.x(frame), 41, 3, 0, 7);
      context.fill();
    }
    context.fillStyle = "#f0b429";
    context.fillRect(this.x(this.frame) - 1, 8, 2, height - 8);
  }
}
