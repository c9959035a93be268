// SPDX-License-Identifier: Apache-2.0
// The panels beside the picture: fields of the camera, focus and key, layers with their methods, facts.
import * as cam from "./camera.js";
import { addFields } from "./fields.js";
import { drawMap } from "./map.js";

const element = (id) => document.getElementById(id);
const kSubjectSize = 0.5;  // m
const kMotionInterval = 100;  // ms between updates of numbers while pictures move

/**
 * Connects the panels. app: {state, shotText, timeline, camera(), setCamera(camera, inputTime), sendShot(), restView(), changed(), say(text)}.
 * Returns {refresh(), refreshSoon(), showLayers(), showFacts(header), showRanges(message)}.
 */
export function makePanels({ state, shotText, timeline, camera, setCamera, sendShot, restView, changed, say }) {
  const change = (edit) => (value) => {
    if (value !== undefined) setCamera(edit(cam.copy(camera()), value));
  };
  const updateFields = [
    addFields(element("camera-fields"), [
      ...["x", "y", "z"].map((axis, i) => ({
        name: "position-" + axis, label: axis, unit: "m", step: 0.01, min: -1e6, max: 1e6, get: () => camera().position[i],
        set: change((c, v) => { c.position[i] = v; return c; }),
      })),
      { name: "fov", label: "FOV", unit: "deg", step: 1, min: 0.1, max: 179, get: () => cam.fieldOfView(camera()),
        set: change((c, v) => ({ ...c, focal_length_mm: cam.focalLength(c.film_back_mm, v) })) },
      ...["azimuth", "elevation", "roll"].map((angle) => ({
        name: angle, label: angle[0].toUpperCase() + angle.slice(1), unit: "deg", step: 1, get: () => cam.angles(camera())[angle],
        set: change((c, v) => {
          const turned = { ...cam.angles(c), [angle]: v };
          return { ...c, orientation: cam.fromAngles(turned.azimuth, turned.elevation, turned.roll) };
        }),
      })),
      { name: "focal-length", label: "Focal length", unit: "mm", step: 1, min: 0.1, max: 1e5, get: () => camera().focal_length_mm,
        set: change((c, v) => ({ ...c, focal_length_mm: v })) },
    ], refresh, say),
    addFields(element("subject-fields"), [
      { name: "subject-size", label: "Subject", unit: "m", step: 0.1, min: 0, max: 1e6, get: () => state.subject?.size_m,
        set: (v) => camera() && setSubject(v > 0 ? { point: state.subject?.point ?? cam.focusPoint(camera()), size_m: v } : null) },
    ], refresh, say),
    addFields(element("focus-fields"), [
      { name: "focus", label: "Distance", unit: "m", step: 0.01, min: 0.01, max: 1e6, get: () => camera().focus_m,
        set: (v) => setCamera({ ...cam.copy(camera()), focus_m: v }) },
      { name: "aperture", label: "Aperture", unit: "mm", step: 1, min: 0, max: 1e5,
        get: () => (camera().f_number === undefined ? undefined : camera().focal_length_mm / camera().f_number),
        set: (v) => setCamera({ ...cam.copy(camera()), f_number: v > 0 ? camera().focal_length_mm / v : undefined }) },
      { name: "f-number", label: "f-number", step: 0.1, min: 0.01, max: 1e5, get: () => camera().f_number,
        set: (v) => setCamera({ ...cam.copy(camera()), f_number: v }) },
    ], refresh, say),
    addFields(element("key-fields"), [["tension", "Tension"], ["ease_in", "Ease in"], ["ease_out", "Ease out"]].map(([name, label]) => ({
      name: name.replace("_", "-"), label, step: 0.1, min: 0, max: 1, get: () => (shotText.keyAt(timeline.frame) ?? {})[name] ?? 0,
      set: (v) => shotText.setKeyProperty(timeline.frame, name, v ?? 0) && sendShot(),
    })), refresh, say),
    addFields(element("shot-fields"), [["width", "Width", "pixels", 1, 65535], ["height", "Height", "pixels", 1, 65535],
      ["first_frame", "First frame", "", 0, 9999999], ["last_frame", "Last frame", "", 0, 9999999]].map(([name, label, unit, min, max]) => ({
      name: "shot-" + name.replace("_", "-"), label, unit, step: 1, digits: 0, min, max, get: () => shotText.json?.[name],
      set: (v) => v !== undefined && setShotNumber(name, Math.round(v)),
    })), refresh, say),
  ];

  /** Sets a number of the shot. The first frame moves the last one, or the other way round, rather than to cross it. */
  function setShotNumber(name, value) {
    if (!state.shot) return;
    const isChanged = shotText.change((json) => {
      json[name] = value;
      if (name === "first_frame") json.last_frame = Math.max(json.last_frame, value);
      if (name === "last_frame") json.first_frame = Math.min(json.first_frame, value);
    });
    if (isChanged) sendShot();
  }

  element("shot-name").addEventListener("change", (event) => {
    if (state.shot && shotText.change((json) => { json.name = event.target.value; })) sendShot();
  });
  // A ratio stays text: 24000/1001 is no decimal number.
  element("shot-fps").addEventListener("change", (event) => {
    const text = event.target.value.replaceAll(" ", "");
    const ratio = /^([0-9]{1,9})\/([0-9]{1,9})$/.exec(text);
    const rate = ratio ? ratio[1] / ratio[2] : Number(text);
    if (!state.shot || !(rate > 0 && rate <= 1000)) {
      if (state.shot) say("Frames per second are a number up to 1000, or a ratio such as 24000/1001.");
      return refresh();
    }
    if (shotText.change((json) => { json.fps = ratio ? text : rate; })) sendShot();
  });

  element("focus-slider").addEventListener("input", (event) =>
    setCamera({ ...cam.copy(camera()), focus_m: 1 / Math.max(0.001, Number(event.target.value)) }, event.timeStamp));

  /** What ranges of motion depend on: not on the place. */
  const orientationAndLens = ({ orientation, focal_length_mm, film_back_mm, shift_x, shift_y }) =>
    JSON.stringify([orientation, focal_length_mm, film_back_mm, shift_x, shift_y]);

  function drawShotMap() {
    const cameras = state.shot.layers.flatMap((layer) => layer.cameras ?? []);
    const isOfThisView = state.nested?.view === orientationAndLens(camera());
    const nested = isOfThisView ? state.nested.ranges : [];
    drawMap(element("map"), cameras, camera(), state.shot.path,
      { simple: state.ranges ?? [], nested, subject: state.subject, ofSubject: state.subjectRanges ?? [] });
  }

  /** Sets what must be seen, or null; its range of motion follows the next resting picture. */
  function setSubject(subject) {
    state.subject = subject;
    state.subjectRanges = [];
    element("subject-note").textContent = "";
    restView();
    refresh();
  }
  element("subject-at-focus").addEventListener("click", () => {
    if (camera()) setSubject({ point: cam.focusPoint(camera()), size_m: state.subject?.size_m ?? kSubjectSize });
  });

  /** Shows the ranges of all, 99 and 90 % of the rays of the view that rests, and that of the subject. */
  function showRanges({ ranges }) {
    if (!state.shot) return;
    const nested = ranges.filter((range) => !range.of_subject);
    if (nested.length) state.nested = { view: orientationAndLens(camera()), ranges: nested };
    state.subjectRanges = state.subject ? ranges.filter((range) => range.of_subject) : [];
    const reasons = state.subjectRanges.map((range) => range.empty_because).filter(Boolean);
    element("subject-note").textContent = reasons.length ? `No range of the subject: ${reasons.join("; ")}.` : "";
    drawShotMap();
  }

  function refresh() {
    if (!state.shot) return;
    for (const update of updateFields) update();
    const slider = element("focus-slider");
    const nearest = Math.min(...state.shot.layers.map((layer) => layer.depth_range?.[0] ?? Infinity));
    slider.max = Math.max(2, 1.5 / nearest, 1.1 / cam.focusDistance(camera()));
    if (document.activeElement !== slider) slider.value = 1 / cam.focusDistance(camera());
    element("frame").value = timeline.frame;
    for (const name of ["name", "fps"]) {
      const field = element("shot-" + name);
      if (document.activeElement !== field) field.value = shotText.json?.[name] ?? "";
    }
    element("file").textContent = shotText.file + (shotText.json && shotText.isChanged() ? " *" : "");
    element("undo").disabled = shotText.past.length === 0;
    element("redo").disabled = shotText.future.length === 0;
    element("delete-key").disabled = !shotText.keyAt(timeline.frame) || shotText.keys().length < 2;
    element("to-path").disabled = !state.own;
    element("to-keys").hidden = !shotText.json || shotText.canSetKeys();
    for (const update of updateTimeFields) update();
    element("key-fields").hidden = !shotText.keyAt(timeline.frame);
    changed();
    timeline.draw();
    drawShotMap();
  }

  let updateTimeFields = [];
  /** Adds the fields of a light field layer's time: at a constant speed, or by keys. */
  function addTimeFields(parent, index) {
    const fields = document.createElement("div");
    fields.className = "fields";
    const json = () => shotText.json.layers[index] ?? {};
    const secondsAt = (frame) => {
      const { start_seconds = 0, speed = 1, time_keys } = json(), { first_frame, fps, layers } = state.shot;
      return time_keys ? layers[index]?.seconds[frame - first_frame] : start_seconds + (frame - first_frame) / fps * speed;
    };
    const ends = () => [...new Set([state.shot.first_frame, state.shot.last_frame])].map((frame) => ({ frame, seconds: secondsAt(frame) }));
    const constant = (name, label, unit, fallback) => ({
      name: `${name}-${index}`, label, unit, step: 0.1, get: () => json()[name] ?? fallback,
      set: (v) => shotText.setLayerTime(index, name, v ?? fallback) && sendShot(),
    });
    const specs = json().time_keys ? [] : [constant("start_seconds", "Start", "s", 0), constant("speed", "Speed", "", 1)];
    specs.push({
      name: `time-${index}`, label: "Time", unit: "s", step: 0.1, get: () => secondsAt(timeline.frame),
      set: (v) => v !== undefined && shotText.setTimeKey(index, timeline.frame, v, ends()) && sendShot(),
    });
    updateTimeFields.push(addFields(fields, specs, refresh, say));
    const set = document.createElement("button"), remove = document.createElement("button");
    set.textContent = "Set time key";
    set.title = "Keep the time in the take at this frame";
    set.id = `set-time-key-${index}`;
    set.addEventListener("click", () => specs.at(-1).set(specs.at(-1).get()));
    remove.textContent = "Delete time key";
    remove.id = `delete-time-key-${index}`;
    remove.addEventListener("click", () => shotText.deleteTimeKey(index, timeline.frame) && sendShot());
    updateTimeFields.push(() => { remove.disabled = !shotText.timeKeyAt(index, timeline.frame); });
    const row = document.createElement("div");
    row.className = "row";
    row.append(set, remove);
    parent.append(fields, row);
  }

  function showLayers() {
    const parent = element("layers");
    const focused = parent.contains(document.activeElement) ? document.activeElement.id : "";
    parent.replaceChildren();
    updateTimeFields = [];
    state.shot.layers.forEach((layer, index) => {
      const label = document.createElement("label");
      label.append(layer.name || `Layer ${index + 1}`);
      if (layer.method) {
        const select = document.createElement("select");
        select.id = "method-" + index;
        for (const { name } of state.methods) select.append(new Option(name + costText(name), name, false, name === layer.method));
        select.addEventListener("change", () => {
          shotText.change((json) => {
            json.layers[index].method = select.value;
            delete json.layers[index].options;  // they belong to the other method
          });
          sendShot();
        });
        label.append(select);
        const found = state.methods.find((method) => method.name === layer.method);
        element("focus-note").textContent = !found ? "" :
          (found.uses_focal_plane ? "" : `${found.name} is sharp at every depth: the distance has no effect. `) +
          (found.has_lens ? "" : `The aperture has an effect with ${state.methods.filter((m) => m.has_lens).map((m) => m.name).join(", ")} only.`);
        element("method-summary").textContent = found ? found.summary + (found.artefacts ? ". Visible errors: " + found.artefacts : "") + "." : "";
      }
      parent.append(label);
      if (layer.seconds) addTimeFields(parent, index);
    });
    for (const update of updateTimeFields) update();  // before one of them has the focus again
    if (focused) element(focused)?.focus();
  }

  /** Returns what is known of a method's error and time: as measured on this take, or by this page. */
  function costText(name) {
    const measured = state.shot.measurements.find(({ method }) => method === name);
    if (measured) return ` (${measured.psnr_db.toFixed(1)} dB, ${measured.seconds.toFixed(2)} s)`;
    const { rendering, estimation } = state.seconds[name] ?? {};
    const times = [rendering === undefined ? "" : rendering.toFixed(2) + " s", estimation === undefined ? "" : estimation.toFixed(1) + " s where depths are not stored"];
    const text = times.filter(Boolean).join(", ");
    return text && ` (${text})`;
  }

  /** Shows which depths the false colours mean. span: [far, near], 1/m. */
  let legend = "";
  function showLegend(span) {
    const next = span ? span.join() : "";
    if (next === legend) return;  // moving pictures: the page has no layout to do
    legend = next;
    element("legend").hidden = !span;
    const text = (inverse) => (inverse > 0 ? (1 / inverse).toFixed(2) + " m" : "infinity");
    ["far", "near"].forEach((end, i) => { element("legend-" + end).textContent = span ? text(span[i]) : ""; });
  }

  let factsTime = 0;
  function showFacts(header) {
    state.picture = header;
    if (header.quality === "live") {
      state.liveCamera ??= header.camera;
      showLegend(undefined);
      return;
    }
    showLegend(header.false_colors);
    if (!state.shot) return;
    state.ranges = header.ranges ?? [];
    if (header.quality === "resting" && header.method === "") element("progress-row").hidden = true;
    const [layer] = state.shot.layers.filter(({ method }) => method);
    if (header.quality === "resting" && header.method === "" && layer) {
      const kind = state.estimated === header.id ? "estimation" : "rendering";
      state.seconds[layer.method] = { ...state.seconds[layer.method], [kind]: header.render_ms / 1000 };
    }
    const now = performance.now();
    if (header.quality !== "resting" && now - factsTime < kMotionInterval) return;
    factsTime = now;
    if (header.quality === "resting") drawShotMap();
    const facts = [
      ["Rendered", `${header.width} x ${header.height}${header.method ? ", " + header.method : ""}`],
      ["Time", `${header.render_ms.toFixed(1)} + ${header.picture_ms.toFixed(1)} ms`],
      ["Missing pixels", (100 * header.uncovered).toFixed(1) + " %"],
      ["Absent cameras", header.absent_cameras ? header.absent_cameras.join(", ") : "none"],
    ];
    if (header.held) facts.push(["Instant", "missing, the nearest is shown"]);
    if (header.false_colors) facts.push(["Blue to red", header.false_colors.map((d) => d > 0 ? (1 / d).toFixed(2) + " m" : "infinity").join(" to ")]);
    if (header.notes) facts.push(["Note", header.notes.join(" ")]);
    const list = element("facts");
    list.replaceChildren(...facts.flatMap(([name, value]) => {
      const term = document.createElement("dt"), data = document.createElement("dd");
      term.textContent = name;
      data.textContent = value;
      return [term, data];
    }));
  }

  /** Refreshes a moment later, once for all calls until then: pictures come before numbers. */
  let timer = null;
  function refreshSoon() {
    timer ??= setTimeout(() => {
      timer = null;
      refresh();
    }, kMotionInterval);
  }

  return { refresh, refreshSoon, showLayers, showFacts, showRanges };
}
