// SPDX-License-Identifier: Apache-2.0
// The viewer's page: connects the shot, the picture, the timeline and the panels.
import * as cam from "./camera.js";
import { Connection, errorText } from "./connection.js";
import { ShotText } from "./document.js";
import { addFields } from "./fields.js";
import { addKeyboard, addPointerInput, cameraKeys } from "./input.js";
import { drawMap } from "./map.js";
import { Timeline } from "./timeline.js";
import { drawGuides, View } from "./view.js";

const element = (id) => document.getElementById(id);

/** What is shown. `own`: the camera that the user moved, null: that of the shot at the frame. */
const state = { shot: null, own: null, look: {}, methods: [], picture: null };
const shotText = new ShotText();

const camera = () => state.own ?? pathCamera(timeline.frame);
function pathCamera(frame) {
  return state.shot?.path[frame - state.shot.first_frame] ?? state.shot?.path.at(-1);
}

function say(text) { element("status").textContent = text; }

const connection = new Connection({
  open: () => say(""),
  close: () => say("The server has ended. Start raystage replay again."),
  picture: (header, jpeg) => view.receive(header, jpeg),
  message: (message) => {
    if (message.type === "hello") {
      state.methods = message.methods;
      document.body.dataset.folder = message.folder;
    } else if (message.type === "shot") {
      showShot(message);
    } else if (message.type === "dropped") {
      view.failed(message.id);
    } else if (message.type === "error") {
      view.failed(message.id);
      say(errorText(message));
    }
  },
});

const view = new View(element("stage"), element("picture"), element("guides"), {
  request: (quality) => state.shot && {
    frame: timeline.frame, camera: state.own ?? undefined, width: view.width, height: view.height, quality, look: state.look,
  },
  send: (members) => connection.send("view", members),
  shown: {
    picture: showFacts,
    resized: () => drawGuides(element("guides"), element("guides-kind").value, state.shot),
  },
});

const timeline = new Timeline(element("timeline"), {
  keys: () => shotText.json ? shotText.keys().map((key) => key.frame) : [],
  moveKey: (from, to) => shotText.moveKey(from, to) && (sendShot(), true),
  changed: (frame, quality) => {
    state.own = null;
    if (quality === "playing") view.play();
    else if (quality === "resting") view.rest();
    else view.move();
    refreshPanels();
  },
});

function setCamera(next, inputTime = performance.now()) {
  state.own = next;
  view.move(inputTime);
  refreshPanels();
}

// The shot.

function showShot(message) {
  const isOther = !state.shot || message.file !== shotText.file;
  if (isOther) {
    shotText.reset(message.file, message.text);
    state.own = null;
  }
  state.shot = message;
  element("title").textContent = message.name || "Raystage";
  document.title = (message.name || "shot") + " - Raystage";
  timeline.reset(message.first_frame, message.last_frame, message.fps);
  view.setAspect(message.width / message.height);
  showLayers();
  refreshPanels();
  say("");
}

/** Sends the edited shot; the server answers with its path, or an error. */
function sendShot() {
  const frame = timeline.frame;
  connection.ask("shot", { file: shotText.file, text: shotText.text() })
    .then(() => { if (timeline.frame === frame) view.rest(); })
    .catch((error) => say(error.message));
  refreshPanels();
}

function undo(step) {
  if (!step) return;
  state.own = null;
  sendShot();
}

function setKey() {
  if (!shotText.canSetKeys()) return say("Keys cannot be set: the camera follows a file, a target, an orbit or a dolly zoom.");
  if (shotText.setKey(timeline.frame, cam.copy(camera()))) sendShot();
  state.own = null;
}

function ask(question, name, canReplace) {
  const dialog = element("file-dialog");
  element("file-question").textContent = question;
  element("file-name").value = name;
  element("replace").checked = false;
  element("replace-label").hidden = !canReplace;
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () =>
    resolve(dialog.returnValue === "ok" && element("file-name").value ? {
      file: element("file-name").value, replace: element("replace").checked,
    } : null), { once: true }));
}

async function save() {
  const answer = await ask("Save the shot as", shotText.file, true);
  if (!answer) return;
  try {
    await connection.ask("save", { ...answer, text: shotText.text() });
    shotText.file = answer.file;
    shotText.savedText = shotText.text();
    say("Saved " + answer.file);
    refreshPanels();
  } catch (error) {
    say(error.message);
  }
}

async function open() {
  const answer = await ask("Open the shot file", shotText.file, false);
  if (!answer) return;
  try {
    await connection.ask("open", { file: answer.file });
  } catch (error) {
    say(error.message);
  }
}

async function snapshot() {
  const answer = await ask("Write this frame as .exr or .png", `frame.${String(timeline.frame).padStart(4, "0")}.png`, true);
  if (!answer) return;
  say("Writing " + answer.file);
  try {
    await connection.ask("snapshot", { ...answer, frame: timeline.frame, camera: state.own ?? undefined, look: state.look });
    say("Written " + answer.file);
  } catch (error) {
    say(error.message);
  }
}

// Focus.

async function focusAt(event) {
  const [x, y] = view.pixelAt(event);
  const start = performance.now();
  try {
    const { distance_m } = await connection.ask("focus", {
      frame: timeline.frame, camera: state.own ?? undefined, width: view.width, height: view.height, pixel: [x, y],
    });
    state.focusMs = performance.now() - start;
    setCamera({ ...camera(), focus_m: distance_m });
  } catch (error) {
    say(error.message);
  }
}

let probeUnderWay = false;
async function hover(event) {
  if (probeUnderWay || !state.shot || timeline.playing) return;
  probeUnderWay = true;
  const [x, y] = view.pixelAt(event);
  try {
    const found = await connection.ask("probe", {
      frame: timeline.frame, camera: state.own ?? undefined, width: view.width, height: view.height, pixel: [x, y], look: state.look,
    });
    element("readout").textContent = `${Math.floor(x)}, ${Math.floor(y)}   linear ${found.rgba.map((v) => v.toFixed(4)).join(" ")}` +
      `   display ${found.display.join(" ")}   Z ${found.z === null ? "-" : found.z.toFixed(3) + " m"}` +
      (found.coverage === undefined ? "" : `   coverage ${found.coverage.toFixed(2)}`);
  } catch { /* the next pixel may have an answer */ }
  setTimeout(() => { probeUnderWay = false; }, 100);
}

addPointerInput(element("picture"), { camera, setCamera, focusAt, hover, rest: () => view.rest() });

// Panels.

const change = (edit) => (value) => {
  if (value !== undefined) setCamera(edit(cam.copy(camera()), value));
};
const updateFields = [
  addFields(element("camera-fields"), [
    ...["x", "y", "z"].map((axis, i) => ({
      name: "position-" + axis, label: axis, unit: "m", step: 0.01, get: () => camera().position[i],
      set: change((c, v) => { c.position[i] = v; return c; }),
    })),
    { name: "fov", label: "Field of view", unit: "deg", step: 1, get: () => cam.fieldOfView(camera()),
      set: change((c, v) => ({ ...c, focal_length_mm: cam.focalLength(c.film_back_mm, Math.min(179, Math.max(0.1, v))) })) },
    ...["azimuth", "elevation", "roll"].map((angle) => ({
      name: angle, label: angle[0].toUpperCase() + angle.slice(1), unit: "deg", step: 1, get: () => cam.angles(camera())[angle],
      set: change((c, v) => {
        const turned = { ...cam.angles(c), [angle]: v };
        return { ...c, orientation: cam.fromAngles(turned.azimuth, turned.elevation, turned.roll) };
      }),
    })),
    { name: "focal-length", label: "Focal length", unit: "mm", step: 1, get: () => camera().focal_length_mm,
      set: change((c, v) => ({ ...c, focal_length_mm: Math.max(0.1, v) })) },
  ], refreshPanels),
  addFields(element("focus-fields"), [
    { name: "focus", label: "Distance", unit: "m", step: 0.01, get: () => camera().focus_m,
      set: (v) => setCamera({ ...cam.copy(camera()), focus_m: v === undefined ? undefined : Math.max(0.01, v) }) },
    { name: "f-number", label: "f-number", step: 0.1, get: () => camera().f_number,
      set: (v) => setCamera({ ...cam.copy(camera()), f_number: v === undefined ? undefined : Math.max(0.01, v) }) },
  ], refreshPanels),
];
element("focus-slider").addEventListener("input", (event) =>
  setCamera({ ...cam.copy(camera()), focus_m: 1 / Math.max(0.001, Number(event.target.value)) }, event.timeStamp));

function refreshPanels() {
  if (!state.shot) return;
  for (const update of updateFields) update();
  const slider = element("focus-slider");
  if (document.activeElement !== slider) slider.value = 1 / cam.focusDistance(camera());
  element("frame").value = timeline.frame;
  element("file").textContent = shotText.file + (shotText.json && shotText.isChanged() ? " *" : "");
  element("undo").disabled = shotText.past.length === 0;
  element("redo").disabled = shotText.future.length === 0;
  element("delete-key").disabled = !shotText.keyAt(timeline.frame) || shotText.keys().length < 2;
  element("to-path").disabled = !state.own;
  timeline.draw();
  drawMap(element("map"), state.shot.layers.flatMap((layer) => layer.cameras ?? []), camera(), state.shot.path);
}

function showLayers() {
  const parent = element("layers");
  parent.replaceChildren();
  state.shot.layers.forEach((layer, index) => {
    const label = document.createElement("label");
    label.append(layer.name || `Layer ${index + 1}`);
    if (layer.method) {
      const select = document.createElement("select");
      select.id = "method-" + index;
      for (const { name } of state.methods) select.append(new Option(name, name, false, name === layer.method));
      select.addEventListener("change", () => {
        shotText.change((json) => {
          json.layers[index].method = select.value;
          delete json.layers[index].options;  // they belong to the other method
        });
        sendShot();
      });
      label.append(select);
      const found = state.methods.find((method) => method.name === layer.method);
      element("method-summary").textContent = found ? found.summary + (found.artefacts ? ". Visible errors: " + found.artefacts : "") + "." : "";
    }
    parent.append(label);
  });
}

function showFacts(header) {
  state.picture = header;
  if (timeline.playing) ++timeline.statistics.shown;
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

// Look.

function changeLook(name, value) {
  if (value === undefined || value === "" || value === false) delete state.look[name];
  else state.look[name] = value;
  view.rest();
}
element("channel").addEventListener("change", (event) => changeLook("channel", event.target.value));
element("exposure").addEventListener("change", (event) => changeLook("exposure", Number(event.target.value) || 0));
element("black").addEventListener("change", (event) => changeLook("black", event.target.checked));
element("peaking").addEventListener("change", (event) => changeLook("peaking", event.target.checked));
const kDisplays = [["", ""], ["sRGB", "Plain"], ["sRGB", "ACES 1.0 SDR"], ["Rec.1886", "Plain"], ["Rec.1886", "ACES 1.0 SDR"],
  ["P3-D65", "Plain"], ["P3-D65", "ACES 1.0 SDR"]];
for (const [display, name] of kDisplays) element("display").append(new Option(display ? `${display}, ${name}` : "Default", `${display}|${name}`));
element("display").addEventListener("change", (event) => {
  const [display, name] = event.target.value.split("|");
  changeLook("display", display);
  changeLook("view", name);
});
element("guides-kind").addEventListener("change", (event) => drawGuides(element("guides"), event.target.value, state.shot));

// Buttons and keys.

const stepFrame = (step) => timeline.go(timeline.frame + step);
const actions = {
  undo: () => undo(shotText.undo()), redo: () => undo(shotText.redo()), open, save, snapshot,
  help: () => element("help-dialog").showModal(),
  first: () => timeline.go(timeline.in), last: () => timeline.go(timeline.out),
  back: () => stepFrame(-1), forward: () => stepFrame(1),
  play: () => { timeline.toggle(); element("play").textContent = timeline.playing ? "\u23F8" : "\u25B6"; },
  "to-path": () => { state.own = null; view.move(); refreshPanels(); },
  "set-key": setKey,
  "delete-key": () => { if (shotText.deleteKey(timeline.frame)) sendShot(); },
  "set-in": () => { timeline.in = Math.min(timeline.frame, timeline.out); timeline.draw(); },
  "set-out": () => { timeline.out = Math.max(timeline.frame, timeline.in); timeline.draw(); },
};
for (const [id, action] of Object.entries(actions)) element(id).addEventListener("click", action);
element("frame").addEventListener("change", (event) => timeline.go(Number(event.target.value)));
element("speed").addEventListener("change", (event) => timeline.setSpeed(Number(event.target.value)));
element("loop").addEventListener("change", (event) => { timeline.loop = event.target.checked; });

const bindings = [
  ...cameraKeys({ camera, setCamera }),
  ["Home", "Camera of the shot", actions["to-path"]],
  ["Space", "Play or stop", actions.play],
  [",", "One frame back", actions.back],
  [".", "One frame forward", actions.forward],
  ["Shift+< Shift+,", "First frame", actions.first],
  ["Shift+> Shift+.", "Last frame", actions.last],
  ["k", "Set a key", setKey],
  ["Delete", "Delete the key", actions["delete-key"]],
  ["i", "Start of the loop", actions["set-in"]],
  ["o", "End of the loop", actions["set-out"]],
  ["Ctrl+z", "Undo", actions.undo],
  ["Ctrl+Shift+z Ctrl+y", "Redo", actions.redo],
  ["Ctrl+s", "Save", save],
  ["Ctrl+o", "Open", open],
  ["f", "Full screen", () => document.fullscreenElement ? document.exitFullscreen() : element("stage").requestFullscreen()],
  ["?", "This list", actions.help],
];
addKeyboard(bindings);
element("keys").replaceChildren(...bindings.map(([keys, text]) => {
  const row = document.createElement("tr");
  for (const cell of [keys.split(" ")[0], text]) row.insertCell().textContent = cell;
  return row;
}));

addEventListener("beforeunload", (event) => {
  if (shotText.json && shotText.isChanged() && navigator.userActivation.hasBeenActive) event.preventDefault();
});
setInterval(() => {
  if (!timeline.playing) return;
  const { wanted, shown } = timeline.statistics;
  element("rate").textContent = `${shown} of ${wanted} frames shown`;
}, 500);

/** For tests and curious users: what the page knows and measured. */
globalThis.raystage = { state, view, timeline, shotText, connection, camera, setCamera };
