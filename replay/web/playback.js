// SPDX-License-Identifier: Apache-2.0
// Playing at true speed. Pictures are requested some frames before they are due and wait for their
// time, so that one that takes long is not late. Where rendering is slower than the shot, frames
// are left out; playing never becomes slower.
import { decodePicture } from "./picture.js";

const kAhead = 8;          // pictures that wait, or are under way
const kUnderWay = 2;       // one is rendered, one is on its way
const kPreroll = 4;        // pictures that wait before the clock starts
const kMaxPreroll = 1500;  // ms

export class Playback {
  /**
   * options: {send(frame): requests a picture and returns its id; show(header, bitmap): at its time; go(frame): the frame that is due;
   * ended(frame): at the end of a loop that is off}.
   */
  constructor(options) {
    this.options = options;
    this.playing = false;
    this.statistics = { wanted: 0, shown: 0 };
  }

  /** Starts at a frame. range(): {first, last, fps, speed, loop}, which may change later. */
  start(frame, range) {
    this.playing = true;
    this.run = (this.run ?? 0) + 1;
    this.range = range;
    this.statistics = { wanted: 0, shown: 0 };
    this.begin(frame);
    const run = this.run;
    const tick = () => {
      if (this.run !== run || !this.playing) return;
      this.tick(performance.now());
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  /** Counts steps anew from a frame, e.g. when the speed changes. */
  begin(frame) {
    this.startFrame = frame;
    this.startTime = null;  // the clock starts with the first pictures: a cold disk does not make them late
    this.due = 0;           // step that is due; a step is one frame of the shot
    this.next = 0;          // step to request
    this.underWay = new Map();  // id -> {step, sent}
    for (const { bitmap } of this.queue ?? []) bitmap.close();
    this.queue = [];        // {step, header, bitmap}, by step
    this.interval = 0;      // ms from picture to picture, as measured
    this.patience = performance.now() + kMaxPreroll;
    this.pump();
  }

  stop() {
    this.playing = false;
    for (const { bitmap } of this.queue ?? []) bitmap.close();
    this.queue = [];
    this.underWay?.clear();
  }

  /** Returns the frame of a step, or null beyond the end. */
  frameOf(step) {
    const { first, last, speed, loop } = this.range();
    const frame = this.startFrame + (speed < 0 ? -step : step), count = last - first + 1;
    if (frame >= first && frame <= last) return frame;
    return loop ? first + ((frame - first) % count + count) % count : null;
  }

  stepAt(now) {
    const { fps, speed } = this.range();
    return this.startTime === null ? 0 : Math.floor((now - this.startTime) / 1000 * fps * Math.abs(speed));
  }

  /** Requests the next pictures. */
  pump() {
    while (this.playing && this.underWay.size < kUnderWay && this.queue.length + this.underWay.size < kAhead) {
      if (this.startTime !== null) {
        // Where every frame would be too slow: the next one that can arrive in time.
        this.next = Math.max(this.next, this.stepAt(performance.now() + this.interval * (this.underWay.size + 1)));
      }
      const frame = this.frameOf(this.next);
      if (frame === null) return;
      this.underWay.set(this.options.send(frame), { step: this.next, sent: performance.now() });
      ++this.next;
    }
  }

  async receive(header, jpeg) {
    const run = this.run, request = this.underWay.get(header.id);
    if (!request) return;
    const bitmap = await decodePicture(jpeg);
    if (this.run !== run || !this.underWay.delete(header.id)) return bitmap.close();
    const took = performance.now() - Math.max(request.sent, this.lastArrival ?? 0);
    this.lastArrival = performance.now();
    this.interval = this.interval ? 0.8 * this.interval + 0.2 * took : took;
    this.queue.push({ step: request.step, header, bitmap });
    this.queue.sort((a, b) => a.step - b.step);
    this.pump();
  }

  /** Requests before this one will not be answered any more: the server sends only the newest picture. */
  passed(id) {
    if (!this.playing) return;
    for (const older of this.underWay.keys()) if (older < id) this.underWay.delete(older);
    this.pump();
  }

  /** A request that was not answered. */
  failed(id) {
    if (this.playing && this.underWay.delete(id)) this.pump();
  }

  tick(now) {
    if (this.startTime === null) {
      const isReady = this.queue.length >= kPreroll || (this.queue.length > 0 && this.underWay.size === 0);
      if (!isReady && now < this.patience) return;
      this.startTime = now;
    }
    const step = this.stepAt(now);
    const frame = this.frameOf(step);
    if (frame === null) {
      this.stop();
      return this.options.ended();
    }
    if (step !== this.due) {
      this.statistics.wanted += step - this.due;
      this.due = step;
      this.options.go(frame);
    }
    let found = null;
    while (this.queue.length > 0 && this.queue[0].step <= step) {
      found?.bitmap.close();
      found = this.queue.shift();
    }
    if (found) {
      if (found.step === step && step > 0) ++this.statistics.shown;
      this.options.show(found.header, found.bitmap);
    }
    this.pump();
  }
}
