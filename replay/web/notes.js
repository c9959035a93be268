// SPDX-License-Identifier: Apache-2.0
// Notes on frames, kept in NAME.notes.json beside the shot. Each change is written at once.

const kSchema = "raystage/shot_notes/1";
const kAttempts = 5;  // to write notes that other pages change, too

export class Notes {
  /** options: {ask(type, members), file(), frame(), go(frame), changed(), say(text)}. */
  constructor(list, text, options) {
    this.list = list;
    this.text = text;
    this.options = options;
    this.json = { schema: kSchema, notes: [] };
    this.stored = "";  // what the file holds, as far as this page knows
  }

  /** Shows the notes of a shot. `text`: the document; undefined: there is none. */
  reset(text) {
    this.stored = text ?? "";
    this.json = text ? JSON.parse(text) : { schema: kSchema, notes: [] };
    this.show();
  }

  frames() { return this.json.notes.map((note) => note.frame); }

  async add() {
    const text = this.text.value.trim(), frame = this.options.frame();
    if (!text) return;
    const isAdded = await this.change((notes) => [...notes, { frame, text }].sort((a, b) => a.frame - b.frame));
    if (isAdded) this.text.value = "";
  }

  remove(note) {
    const isOther = (other) => other.frame !== note.frame || other.text !== note.text;
    return this.change((notes) => notes.filter(isOther));
  }

  /** Changes the notes by edit(notes) and writes them; again if another page has changed them. */
  async change(edit) {
    for (let attempt = 0; attempt < kAttempts; ++attempt) {
      const json = { ...this.json, notes: edit(this.json.notes) }, text = JSON.stringify(json, null, 2) + "\n";
      try {
        const answer = await this.options.ask("notes", { file: this.options.file(), text, previous: this.stored || undefined });
        if (answer.type === "noted") {
          this.json = json;
          this.stored = text;
          this.show();
          return true;
        }
        this.reset(answer.text);
      } catch (error) {
        this.options.say("The note is not saved. " + error.message);
        return false;
      }
    }
    this.options.say("The note is not saved: other pages change the notes at this moment.");
    return false;
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
