// SPDX-License-Identifier: Apache-2.0
// The shot document with undo and redo. It stays as it was read: remarks, layers and properties that
// the viewer does not know are kept.

const kMaxSteps = 200;

export class ShotText {
  constructor() {
    this.file = "";
    this.json = null;
    this.past = [];
    this.future = [];
    this.savedText = "";
  }

  /** Forgets the document. */
  close() {
    this.file = "";
    this.json = null;
    this.past = [];
    this.future = [];
  }

  /** Replaces the document, e.g. by one that was opened. */
  reset(file, text) {
    this.file = file;
    this.json = JSON.parse(text);
    this.past = [];
    this.future = [];
    this.savedText = this.text();
  }

  text() { return JSON.stringify(this.json, null, 2) + "\n"; }
  isChanged() { return this.json !== null && this.text() !== this.savedText; }

  /** Changes the document by edit(json), which undo() takes back. isContinued: together with the change before. */
  change(edit, isContinued = false) {
    const before = this.text();
    edit(this.json);
    if (this.text() === before) return false;
    if (isContinued && this.past.length > 0) return true;
    this.past.push(before);
    if (this.past.length > kMaxSteps) this.past.shift();
    this.future = [];
    return true;
  }

  undo() { return this.step(this.past, this.future); }
  redo() { return this.step(this.future, this.past); }
  step(from, to) {
    if (from.length === 0) return false;
    to.push(this.text());
    this.json = JSON.parse(from.pop());
    return true;
  }

  keys() { return this.json.camera?.keys ?? []; }
  keyAt(frame) { return this.keys().find((key) => key.frame === frame); }

  /** Sets a key at a frame: "all" of the camera, its "pose", "lens" or "focus". Other properties of the key stay. */
  setKey(frame, camera, what = "all") {
    const has = (part) => what === "all" || what === part;
    return this.change((json) => {
      json.camera ??= {};
      json.camera.keys ??= [];
      const keys = json.camera.keys;
      let key = keys.find((k) => k.frame === frame);
      if (!key) {
        key = { frame };
        keys.push(key);
        keys.sort((a, b) => a.frame - b.frame);
      }
      const set = (name, value) => {
        if (value === undefined) delete key[name];
        else key[name] = value;
      };
      if (has("pose")) {
        delete key.target;
        delete key.roll_deg;
        set("position", camera.position);
        set("orientation", camera.orientation);
      }
      if (has("lens")) {
        delete key.horizontal_fov_deg;
        set("focal_length_mm", camera.focal_length_mm);
        set("shift_x", camera.shift_x);
        set("shift_y", camera.shift_y);
        set("f_number", camera.f_number);
      }
      if (has("focus")) set("focus_m", camera.focus_m);
    });
  }

  /** Sets a property of the key at a frame; 0 removes it. */
  setKeyProperty(frame, name, value) {
    return this.change((json) => {
      const key = json.camera?.keys?.find((k) => k.frame === frame);
      if (!key) return;
      if (value) key[name] = value;
      else delete key[name];
    });
  }

  deleteKey(frame) {
    return this.change((json) => {
      const keys = json.camera?.keys ?? [];
      const at = keys.findIndex((key) => key.frame === frame);
      if (at >= 0 && keys.length > 1) keys.splice(at, 1);
    });
  }

  /** Moves a key to another frame without one. isContinued: as change(). */
  moveKey(from, to, isContinued = false) {
    return this.change((json) => {
      const keys = json.camera?.keys ?? [];
      const key = keys.find((k) => k.frame === from);
      if (!key || keys.some((k) => k.frame === to)) return;
      key.frame = to;
      keys.sort((a, b) => a.frame - b.frame);
    }, isContinued);
  }

  /** Replaces a camera that follows a file, a target, an orbit or a dolly zoom by keys. */
  replaceCamera(keys) {
    return this.change((json) => {
      for (const replaced of ["file", "orbit", "dolly_zoom"]) delete json.camera[replaced];
      json.camera.keys = keys;
    });
  }

  timeKeyAt(layer, frame) { return this.json.layers[layer]?.time_keys?.find((key) => key.frame === frame); }

  /** Sets the time in the take at a frame. `ends`: keys that hold the present constant speed. */
  setTimeKey(layer, frame, value, ends) {
    return this.change((json) => {
      const target = json.layers[layer];
      target.time_keys ??= ends;
      delete target.start_seconds;
      delete target.speed;
      let key = target.time_keys.find((k) => k.frame === frame);
      if (!key) {
        key = { frame };
        target.time_keys.push(key);
        target.time_keys.sort((a, b) => a.frame - b.frame);
      }
      key.seconds = value;
    });
  }

  /** Deletes a time key; the last one leaves the layer at that time, frozen. */
  deleteTimeKey(layer, frame) {
    return this.change((json) => {
      const target = json.layers[layer], key = this.timeKeyAt(layer, frame);
      if (!key) return;
      target.time_keys = target.time_keys.filter((other) => other !== key);
      if (target.time_keys.length > 0) return;
      delete target.time_keys;
      target.start_seconds = key.seconds;
      target.speed = 0;
    });
  }

  /** Sets the start or the speed of a layer without time keys. */
  setLayerTime(layer, name, value) {
    return this.change((json) => { json.layers[layer][name] = value; });
  }

  timeKeyFrames() { return this.json.layers.flatMap((layer) => (layer.time_keys ?? []).map((key) => key.frame)); }

  /** Returns whether keys can hold whole cameras: none looks at a target or comes from a file. */
  canSetKeys() {
    const camera = this.json.camera ?? {};
    return !camera.file && !camera.orbit && !camera.dolly_zoom && !this.keys().some((key) => key.target);
  }
}
