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

  /** Replaces the document, e.g. by one that was opened. */
  reset(file, text) {
    this.file = file;
    this.json = JSON.parse(text);
    this.past = [];
    this.future = [];
    this.savedText = this.text();
  }

  text() { return JSON.stringify(this.json, null, 2) + "\n"; }
  isChanged() { return this.text() !== this.savedText; }

  /** Changes the document by edit(json), which undo() takes back. */
  change(edit) {
    const before = this.text();
    edit(this.json);
    if (this.text() === before) return false;
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

  /** Sets a key of the whole camera at a frame. Other properties of a key that exists stay. */
  setKey(frame, camera) {
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
      for (const replaced of ["target", "roll_deg", "horizontal_fov_deg", "focus_m", "f_number"]) delete key[replaced];
      key.position = camera.position;
      key.orientation = camera.orientation;
      key.focal_length_mm = camera.focal_length_mm;
      if (camera.focus_m !== undefined) key.focus_m = camera.focus_m;
      if (camera.f_number !== undefined) key.f_number = camera.f_number;
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

  /** Moves a key to another frame without one. */
  moveKey(from, to) {
    return this.change((json) => {
      const keys = json.camera?.keys ?? [];
      const key = keys.find((k) => k.frame === from);
      if (!key || keys.some((k) => k.frame === to)) return;
      key.frame = to;
      keys.sort((a, b) => a.frame - b.frame);
    });
  }

  /** Returns whether keys can hold whole cameras: none looks at a target or comes from a file. */
  canSetKeys() {
    const camera = this.json.camera ?? {};
    return !camera.file && !camera.orbit && !camera.dolly_zoom && !this.keys().some((key) => key.target);
  }
}
