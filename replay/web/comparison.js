// SPDX-License-Identifier: Apache-2.0
// The wipe between the view and something else: other settings of the shot, another method, another
// version, or a rendered sequence.

export class Comparison {
  /** elements: {kind, file, wipe, keep}. options: {shotText, methods(), changed(), say(text), setWipe(share)}. */
  constructor(elements, options) {
    this.elements = elements;
    this.options = options;
    this.kept = null;  // text of a shot
    elements.kind.addEventListener("change", () => this.choose());
    elements.file.addEventListener("change", () => options.changed());
    elements.wipe.addEventListener("input", () => options.setWipe(Number(elements.wipe.value)));
    elements.keep.addEventListener("click", () => {
      this.kept = options.shotText.text();
      elements.kind.value = "kept";
      this.choose();
    });
  }

  /** Lists the methods to compare with. */
  update() {
    const { kind } = this.elements, chosen = kind.value;
    const choices = [["", "Nothing"], ["kept", "Kept settings"], ["file", "Shot file"], ["sequence", "Rendered EXR files"],
      ...this.options.methods().map(({ name }) => ["method " + name, "Method " + name])];
    kind.replaceChildren(...choices.map(([value, label]) => new Option(label, value)));
    kind.value = choices.some(([value]) => value === chosen) ? chosen : "";
    this.showControls();
  }

  showControls() {
    const { kind, file, wipe } = this.elements;
    file.parentElement.hidden = kind.value !== "file" && kind.value !== "sequence";
    file.placeholder = kind.value === "sequence" ? "renders/shot.####.exr" : "other.json";
    wipe.parentElement.hidden = kind.value === "";
  }

  choose() {
    this.showControls();
    if (this.elements.kind.value === "kept" && !this.kept) this.options.say("Nothing is kept yet: choose Keep these settings first.");
    this.options.changed();
  }

  /** Returns the name of what is right of the wipe. */
  label() {
    const { kind, file } = this.elements;
    if (kind.value === "file" || kind.value === "sequence") return file.value;
    return kind.value.startsWith("method ") ? kind.value.slice("method ".length) : kind.selectedOptions[0]?.textContent ?? "";
  }

  /** Returns the member of a view message, or undefined. */
  member() {
    const kind = this.elements.kind.value, file = this.elements.file.value;
    if (kind === "kept") return this.kept ? { text: this.kept } : undefined;
    if (kind === "file" || kind === "sequence") return file ? { [kind]: file } : undefined;
    if (!kind.startsWith("method ")) return undefined;
    const json = JSON.parse(this.options.shotText.text());
    for (const layer of json.layers ?? []) {
      if (!layer.take) continue;
      layer.method = kind.slice("method ".length);
      delete layer.options;  // they belong to the other method
    }
    return { text: JSON.stringify(json) };
  }
}
