// SPDX-License-Identifier: Apache-2.0
// A take that is being recorded: its newest instant, once per second, and the state of its cameras.

const kShortestInterval = 200;  // ms, while the user moves the virtual camera
const kInterval = 1000;  // ms from request to request: the machine has to record

export class Live {
  /** options: {connection, view, sources, camera(): camera or null, look(), say(text), ended()}. */
  constructor(table, options) {
    this.table = table;
    this.options = options;
    this.file = null;
    this.isMosaic = true;
    this.run = 0;  // counts the loops, of which the latest goes on
  }

  get isOn() { return this.file !== null; }

  /** Follows a take until stop(). */
  async start(file) {
    this.file = file;
    const run = ++this.run;
    while (this.run === run) {
      const start = performance.now();
      const { view, connection, camera, look } = this.options;
      try {
        const status = await connection.ask("live", {
          file, width: view.width || 640, height: view.height || 400, mosaic: this.isMosaic || undefined,
          camera: camera() ?? undefined, look: look(),
        });
        if (this.run !== run) return;
        this.show(status);
        if (status.has_ended) {
          this.options.say("The recording has ended. Run raystage sync, then open the take.");
          this.options.ended();
          return this.stop();
        }
      } catch (error) {
        this.options.say(error.message);
      }
      await new Promise((resolve) => {
        this.hurry = () => setTimeout(resolve, kShortestInterval);
        setTimeout(resolve, Math.max(50, kInterval - (performance.now() - start)));
      });
    }
  }

  stop() {
    ++this.run;
    this.file = null;
  }

  /** Shows all cameras, or the virtual view. */
  showMosaic(isMosaic) {
    this.isMosaic = isMosaic;
    this.options.sources.canvas.hidden = !isMosaic;
    this.hurry?.();
  }

  show(status) {
    this.status = status;
    this.options.say(status.is_held && status.age_s === undefined
      ? "Not viewable until the flush: the recorder keeps all frames in memory."
      : status.age_s === undefined ? "Waiting for the first frames." : `Live, ${status.age_s.toFixed(1)} s old`);
    const rows = status.cameras.map(({ id, fps, dropped, age_s }) => {
      const row = document.createElement("tr");
      for (const text of [id, fps.toFixed(1), dropped, age_s === undefined ? "-" : age_s.toFixed(1) + " s"]) row.insertCell().textContent = text;
      if (dropped > 0 || (age_s ?? 0) > 2) row.className = "problem";
      return row;
    });
    const head = document.createElement("tr");
    for (const text of ["Camera", "Frames/s", "Dropped", "Age"]) head.append(Object.assign(document.createElement("th"), { textContent: text }));
    this.table.replaceChildren(head, ...rows);
  }
}
