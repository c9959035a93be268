// SPDX-License-Identifier: Apache-2.0
// A take that is being recorded: its newest instant, twice per second at most, and how its cameras do.

const kPause = 400;  // ms between an answer and the next request

export class Live {
  /** options: {ask(type, members), view, sources, camera(): camera or null, look(), say(text)}. */
  constructor(table, options) {
    this.table = table;
    this.options = options;
    this.file = null;
  }

  get isOn() { return this.file !== null; }

  /** Follows a take until stop(). */
  async start(file) {
    this.file = file;
    while (this.file === file) {
      const { view, ask, camera, look } = this.options;
      try {
        const { header, jpeg } = await ask("live", {
          file, width: view.width || 640, height: view.height || 400, camera: camera() ?? undefined, look: look(),
        });
        if (this.file !== file) return;
        this.show(header.live);
        await this.options.sources.draw({ header, jpeg });
        if (header.live.has_ended) {
          this.options.say("The recording has ended. Run raystage sync, then open the take.");
          return this.stop();
        }
      } catch (error) {
        this.options.say(error.message);
      }
      await new Promise((resolve) => setTimeout(resolve, kPause));
    }
  }

  stop() { this.file = null; }

  show(live) {
    this.status = live;
    this.options.say(live.is_held && live.age_s === undefined
      ? "Not viewable until the flush: the recorder keeps all frames in memory."
      : live.age_s === undefined ? "Waiting for the first frames." : `Live, ${live.age_s.toFixed(1)} s old`);
    const rows = live.cameras.map(({ id, fps, dropped, age_s }) => {
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
