// SPDX-License-Identifier: Apache-2.0
// The takes and shots of a folder as cards.
import { decodePicture } from "./picture.js";

/** Returns "2 min 05 s" or "3.8 s". */
export function durationText(seconds) {
  if (seconds < 60) return seconds.toFixed(1) + " s";
  const minutes = Math.floor(seconds / 60);
  const rest = String(Math.floor(seconds % 60)).padStart(2, "0");
  return minutes < 60 ? `${minutes} min ${rest} s` : `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

/** Returns "339 MB" or "1.2 TB", powers of 1000. */
export function sizeText(bytes) {
  const units = ["B", "kB", "MB", "GB", "TB", "PB"];
  const power = bytes > 0 ? Math.min(units.length - 1, Math.floor(Math.log10(bytes) / 3)) : 0;
  const value = bytes / 1000 ** power;
  return `${value >= 100 || power === 0 ? Math.round(value) : value.toFixed(1)} ${units[power]}`;
}

export class Folder {
  /** options: {ask(type, members), open(file), live(file), say(text)}. */
  constructor(element, options) {
    this.element = element;
    this.options = options;
  }

  async show(folder) {
    this.element.hidden = false;
    let answer;
    try {
      answer = await this.options.ask("folder", { file: folder });
    } catch (error) {
      return this.options.say(error.message);
    }
    this.folder = folder;
    const title = document.createElement("h2");
    title.textContent = folder === "." ? "Takes and shots" : folder;
    const cards = document.createElement("div");
    cards.className = "cards";
    const pictures = [];
    if (folder !== ".") cards.append(this.card({ kind: "folder", name: ".." }, folder, pictures));
    for (const entry of answer.entries) cards.append(this.card(entry, folder, pictures));
    this.element.replaceChildren(title, cards);
    if (answer.entries.length === 0) cards.append("This folder has no takes and no shots.");
    this.cards = cards;
    for (const { canvas, file } of pictures) {
      if (this.cards !== cards || this.element.hidden) return;  // another folder is shown
      await this.drawThumbnail(canvas, file);
    }
  }

  hide() { this.element.hidden = true; }

  card(entry, folder, pictures) {
    const file = entry.name === ".." ? folder.replace(/\/?[^/]*$/, "") || "." : folder === "." ? entry.name : `${folder}/${entry.name}`;
    const card = document.createElement("button");
    card.className = "card " + entry.kind;
    const canvas = document.createElement("canvas");
    canvas.width = 240;
    canvas.height = 150;
    if (entry.kind === "take" && !entry.problem) pictures.push({ canvas, file });
    const name = document.createElement("strong");
    name.textContent = entry.name;
    const facts = document.createElement("span");
    facts.textContent = entry.problem ? "Cannot be opened: " + entry.problem : factsOf(entry);
    if (entry.problem) facts.className = "problem";
    card.append(...(entry.kind === "take" ? [canvas] : []), name, facts);
    card.disabled = Boolean(entry.problem);
    card.addEventListener("click", () => {
      if (entry.kind === "folder") this.show(file);
      else if (entry.is_recording) this.options.live(file);
      else this.options.open(file);
    });
    return card;
  }

  async drawThumbnail(canvas, file) {
    try {
      const { jpeg } = await this.options.ask("thumbnail", { file, width: canvas.width, height: canvas.height });
      const bitmap = await decodePicture(jpeg);
      canvas.getContext("2d").drawImage(bitmap.source, (canvas.width - bitmap.width) / 2, (canvas.height - bitmap.height) / 2);
      bitmap.close();
    } catch { /* a take without frames has no picture */ }
  }
}

function factsOf(entry) {
  if (entry.kind === "folder") return entry.name === ".." ? "Back" : "Folder";
  if (entry.kind === "shot") return "Shot" + (entry.title ? ": " + entry.title : "");
  const lines = [entry.title, `${entry.cameras} cameras, ${durationText(entry.seconds)}, ${sizeText(entry.bytes)}`];
  if (entry.recorded) lines.push("Recorded " + entry.recorded.slice(0, 16).replace("T", " ") + " UTC");
  if (entry.is_recording) lines.push("Being recorded");
  else if (!entry.verified) lines.push("Not verified");
  else lines.push((entry.is_intact ? "Verified " : "DAMAGED, verified ") + entry.verified.slice(0, 10));
  return lines.filter(Boolean).join("\n");
}
