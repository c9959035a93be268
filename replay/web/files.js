// SPDX-License-Identifier: Apache-2.0
// Opening, saving and exporting, and the copy of unsaved work that survives a crash.

import { kReplaced } from "./connection.js";

const kAutosaveAfter = 1500;  // ms without a change

export class Files {
  /** options: {ask(type, members), shotText, say(text), saved(), request(): frame, camera, look, arrangement}. */
  constructor(dialog, options) {
    this.dialog = dialog;
    this.options = options;
    this.element = (name) => dialog.querySelector("#" + name);
  }

  /** Asks for a file name; the promise is {file, replace} or null. error: why the last answer could not be used. */
  question(text, name, canReplace, error = "") {
    this.element("file-error").textContent = error;
    this.element("file-error").hidden = !error;
    this.element("file-question").textContent = text;
    this.element("file-name").value = name;
    this.element("replace").checked = false;
    this.element("replace-label").hidden = !canReplace;
    this.dialog.returnValue = "";  // Escape leaves it as it is
    this.dialog.showModal();
    return new Promise((resolve) => this.dialog.addEventListener("close", () => {
      const file = this.element("file-name").value;
      resolve(this.dialog.returnValue === "ok" && file ? { file, replace: this.element("replace").checked } : null);
    }, { once: true }));
  }

  /** Asks for a file name until work(answer) succeeds, or the user cancels. */
  async askFor(text, name, canReplace, work, extension = "") {
    for (let error = ""; ;) {
      const answer = await this.question(text, name, canReplace, error);
      if (!answer) return;
      if (extension && !/\.[a-z]+$/i.test(answer.file)) answer.file += extension;
      name = answer.file;
      try {
        return await work(answer);
      } catch (failure) {
        error = failure.message;
      }
    }
  }

  async attempt(work) {
    try {
      await work();
    } catch (error) {
      this.options.say(error.message);
    }
  }

  /** Says so if no shot is open, as while a recording is followed. */
  isReady() {
    if (!this.options.isOpen()) this.options.say("No shot is open.");
    return this.options.isOpen();
  }

  async save() {
    const { ask, shotText, say, saved } = this.options;
    if (!this.isReady()) return;
    await this.askFor("Save the shot as", shotText.file, true, async (answer) => {
      const text = shotText.text(), before = shotText.file;
      const { text: written } = await ask("save", { ...answer, text, shot: before });
      const isEdited = shotText.text() !== text;
      if (written === undefined) {
        shotText.file = answer.file;
        shotText.savedText = text;
      } else if (!isEdited) {
        shotText.reset(answer.file, written);  // its paths start at another folder
      }
      say("Saved " + answer.file);
      saved();
      if (this.keptFile === before && !isEdited) {
        this.keptFile = null;
        ask("autosave", { file: before }).catch(() => {});
      }
    }, ".json");
  }

  async open() {
    await this.askFor("Open the shot file or take", this.options.shotText.file, false,
      ({ file }) => this.options.ask("open", { file }));
  }

  async snapshot(frame) {
    const { ask, say, request } = this.options;
    if (!this.isReady()) return;
    const name = `frame.${String(frame).padStart(4, "0")}.png`;
    await this.askFor("Write this frame as .exr or .png", name, true, async (answer) => {
      say("Writing " + answer.file);
      try {
        await ask("snapshot", { ...answer, ...request(frame) });
        say("Written " + answer.file);
      } catch (error) {
        say("");
        throw error;
      }
    }, ".png");
  }

  async exportCamera() {
    const { ask, say, shotText } = this.options;
    if (!this.isReady()) return;
    const name = shotText.file.replace(/(\.shot)?\.json$/, "") + ".nk";
    await this.askFor("Export the camera as .chan, .gltf or .nk", name, true, async (answer) => {
      await ask("export", answer);
      say("Written " + answer.file);
    }, ".nk");
  }

  /** Begins anew with a shot that was opened. */
  reset() { this.keptFile = null; }

  /** Declares that what is kept for a file is what this page shows. It is forgotten once nothing is unsaved. */
  owns(file) { this.keptFile = file; }

  /** Keeps unsaved changes for the next start, a moment after the last one. */
  autosave() {
    clearTimeout(this.timer);
    const { shotText } = this.options;
    // What an earlier session kept stays until the user has decided about it.
    if (!shotText.json || this.options.isRecoveryOpen()) return;
    if (!shotText.isChanged() && this.keptFile !== shotText.file) return;
    this.timer = setTimeout(() => this.keep(), kAutosaveAfter);
  }

  /** Keeps the changes now, or forgets what was kept if there are none any more. */
  async keep() {
    clearTimeout(this.timer);
    const { ask, shotText, say } = this.options, file = shotText.file;
    const text = shotText.isChanged() ? shotText.text() : undefined;
    if (text !== undefined) this.keptFile = file;
    try {
      await ask("autosave", { file, text });
      if (text === undefined) this.keptFile = null;
      this.hasComplained = false;
    } catch (error) {
      if (error.message === kReplaced) return this.autosave();
      // Said once, and not at every change.
      if (!this.hasComplained) say("Changes are not kept automatically. " + error.message);
      this.hasComplained = true;
    }
  }
}
