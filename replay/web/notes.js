// SPDX-License-Identifier: Apache-2.0
// Notes on frames, kept in NAME.notes.json beside the shot. Each change is written at once.

const kSchema = "raystage/shot_notes/1";

export class Notes {
  /** options: {ask(type, members), file(), frame(), go(frame), changed(), say(text)}. */
  constructor(list, text, options) {
    this.list = list;
    this.text = text;
    this.options = options;
    this.json = { schema: kSchema, notes: [] };
  }

  /** Shows the notes of a shot. `text`: the document; undefined: there is none. */
  reset(text) {
    this.json = text ? JSON.parse(text) : { schema: kSchema, notes: [] };
    this.show();
  }

  frames() { return this.json.notes.map((note) => note.frame); }

  async add() {
    const text = this.text.value.trim();
    if (!text) return;
    this.json.notes.push({ frame: this.options.frame(), text });
    this.json.notes.sort((a, b) => a.frame - b.frame);
    if (await this.write()) this.text.value = "";
  }

  async remove(note) {
    this.json.notes = this.json.notes.filter((other) => other !== note);
    await this.write();
  }

  async write() {
    this.show();
    try {
      await this.options.ask("notes", { file: this.options.file(), text: JSON.stringify(this.json, null, 2) + "\n" });
      return true;
    } catch (error) {
      this.options.say("The note is not saved. " + error.message);
      return false;
    }
  }

  show() {
    this.list.replaceChildren(...this.json.notes.map((note) => {
      const item = document.createElement("li");
      const jump = document.createElement("button"), remove = document.createElement("button");
      jump.textContent = note.frame;
      jump.title = "Go to this frame";
      jump.addEventListener("click", () => this.options.go(note.frame));
      remove.textContent = "Delete";
      remove.addEventListener("click", () => this.remove(note));
      const text = document.createElement("span");
      text.textContent = (note.author ? note.author + ": " : "") + note.text;
      item.append(jump, text, remove);
      return item;
    }));
    this.options.changed();
  }
}
