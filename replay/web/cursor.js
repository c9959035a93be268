// SPDX-License-Identifier: Apache-2.0
// A cursor on the picture that is moved by keys, for what the pointer does by clicks.

const kStep = 16;  // pixels of the page

export class Cursor {
  /** mark: element that shows the cursor in the stage. options: {moved(event), pressed(event)}: as of a pointer there. */
  constructor(mark, stage, options) {
    this.mark = mark;
    this.stage = stage;
    this.options = options;
    stage.addEventListener("pointermove", () => { mark.hidden = true; });
  }

  /** Moves by steps; the first time from the middle. */
  move(x, y) {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (this.mark.hidden) [this.x, this.y] = [width / 2, height / 2];
    this.mark.hidden = false;
    this.x = Math.min(width - 1, Math.max(0, this.x + kStep * x));
    this.y = Math.min(height - 1, Math.max(0, this.y + kStep * y));
    this.mark.style.left = this.x + "px";
    this.mark.style.top = this.y + "px";
    this.options.moved(this.event());
  }

  press() {
    if (!this.mark.hidden) this.options.pressed(this.event());
  }

  event() {
    const box = this.stage.getBoundingClientRect();
    return { clientX: box.left + this.x, clientY: box.top + this.y, offsetX: this.x, offsetY: this.y };
  }
}
