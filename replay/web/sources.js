// SPDX-License-Identifier: Apache-2.0
// What the cameras recorded: all of them as a mosaic, one of them whole, and the epipolar-plane image of
// the row of pixels under the cursor.
import { decodePicture } from "./picture.js";

const kMaxPixels = 2 ** 24, kMaxLength = 8192;  // of a picture

export class Sources {
  /** options: {ask(type, members), request(): members of a view message, say(text), chosen(mode)}. */
  constructor(canvas, epiCanvas, options) {
    this.canvas = canvas;
    this.epiCanvas = epiCanvas;
    this.options = options;
    this.mode = "view";  // "view": the virtual camera; "mosaic"; "source": one camera
    this.camera = null;
    this.cells = [];
    canvas.addEventListener("click", (event) => this.click(event));
  }

  /** Shows the virtual view, the mosaic, or the frame of a camera. */
  show(mode, camera = null) {
    this.mode = mode;
    this.camera = camera;
    this.canvas.hidden = mode === "view";
    this.options.chosen(mode, camera);
    return this.refresh();
  }

  /** Requests the present frame again. Only one request is under way; those that come meanwhile become one. */
  async refresh() {
    if (this.mode !== "mosaic" && this.mode !== "source") return;
    if (this.underWay) {
      this.isStale = true;
      return;
    }
    this.underWay = true;
    do {
      this.isStale = false;
      const stage = this.canvas.parentElement, ratio = devicePixelRatio;
      const fit = Math.min(1, Math.sqrt(kMaxPixels / (stage.clientWidth * ratio * stage.clientHeight * ratio)));
      const pixels = (length) => Math.min(kMaxLength, Math.max(1, Math.floor(length * ratio * fit)));
      const members = { ...this.options.request(), width: pixels(stage.clientWidth), height: pixels(stage.clientHeight) };
      if (this.mode === "source") members.camera_id = this.camera;
      try {
        await this.draw(await this.options.ask(this.mode, members));
      } catch (error) {
        this.options.say(error.message);
      }
    } while (this.isStale && (this.mode === "mosaic" || this.mode === "source"));
    this.underWay = false;
  }

  /** Draws a mosaic or a frame, centred. */
  async draw({ header, jpeg }) {
    const bitmap = await decodePicture(jpeg);
    const stage = this.canvas.parentElement;
    this.canvas.width = Math.round(stage.clientWidth * devicePixelRatio);
    this.canvas.height = Math.round(stage.clientHeight * devicePixelRatio);
    const context = this.canvas.getContext("2d");
    const scale = Math.min(this.canvas.width / bitmap.width, this.canvas.height / bitmap.height);
    const left = (this.canvas.width - bitmap.width * scale) / 2, top = (this.canvas.height - bitmap.height * scale) / 2;
    context.drawImage(bitmap.source, left, top, bitmap.width * scale, bitmap.height * scale);
    bitmap.close();
    this.cells = (header.cells ?? []).map((cell) => ({ ...cell, box: [cell.box[0] * scale + left, cell.box[1] * scale + top, cell.box[2] * scale, cell.box[3] * scale] }));
    context.font = `${11 * devicePixelRatio}px system-ui`;
    const labels = header.content === "source" ? [{ id: header.camera_id, box: [left, top] }] : this.cells;
    for (const { id, box, absent } of labels) {
      const text = absent ? id + " absent" : id;
      context.fillStyle = "#000a";
      context.fillRect(box[0], box[1], context.measureText(text).width + 8, 16 * devicePixelRatio);
      context.fillStyle = absent ? "#e0a030" : "#dcdde0";
      context.fillText(text, box[0] + 4, box[1] + 12 * devicePixelRatio);
    }
  }

  click(event) {
    if (this.mode === "live") return;
    if (this.mode === "source") return this.show("mosaic");
    const x = event.offsetX * devicePixelRatio, y = event.offsetY * devicePixelRatio;
    const cell = this.cells.find(({ box }) => x >= box[0] && y >= box[1] && x < box[0] + box[2] && y < box[1] + box[3]);
    if (cell && !cell.absent) this.show("source", cell.id);
  }

  /** Shows the epipolar-plane image of a pixel's row, if it is switched on. */
  async showEpi(pixel, view) {
    if (this.epiCanvas.hidden || this.epiUnderWay) return;
    this.epiUnderWay = true;
    try {
      const { header, jpeg } = await this.options.ask("epi", { ...this.options.request(), width: view.width, height: view.height, pixel });
      const bitmap = await decodePicture(jpeg);
      const canvas = this.epiCanvas;
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
      const context = canvas.getContext("2d");
      context.drawImage(bitmap.source, 0, 0);
      bitmap.close();
      drawEpiLines(context, header.epi);
      this.epi = header.epi;
    } catch (error) {
      this.options.say(error.message);
    }
    this.epiUnderWay = false;
  }
}

/** Draws the virtual camera's row (yellow) and the point in focus in each camera (blue). */
function drawEpiLines(context, epi) {
  const { width, height } = context.canvas, line = height / epi.cameras.length;
  context.lineWidth = 2;
  context.strokeStyle = "#f0b429";
  context.beginPath();
  epi.view_line.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
  context.fillStyle = "#6ea3dc";
  epi.focus_columns.forEach((x, i) => x !== null && context.fillRect(x - 1.5, i * line, 3, line));
  context.fillStyle = "#000a";
  context.fillRect(0, 0, 190, 18);
  context.fillStyle = "#dcdde0";
  context.font = "11px system-ui";
  context.fillText(`Cameras ${epi.cameras[0]} to ${epi.cameras.at(-1)}`, 6, 13, Math.min(180, width));
}
