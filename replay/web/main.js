// SPDX-License-Identifier: Apache-2.0
// The viewer's page: connects the shot, the picture, the timeline and the panels.
import * as cam from "./camera.js";
import { Comparison } from "./comparison.js";
import { Connection, errorText, kReplaced } from "./connection.js";
import { Cursor } from "./cursor.js";
import { ShotText } from "./document.js";
import { Files } from "./files.js";
import { Folder } from "./folder.js";
import * as headset from "./headset.js";
import { addKeyboard, addPointerInput, cameraKeys } from "./input.js";
import { Live } from "./live.js";
import { addLook } from "./look.js";
import { Notes } from "./notes.js";
import { makePanels } from "./panels.js";
import { Playback } from "./playback.js";
import { Sources } from "./sources.js";
import { Timeline } from "./timeline.js";
import { drawGuides, View } from "./view.js";

const element = (id) => document.getElementById(id);

/** What is shown. `own`: the camera that the user moved, null: that of the shot at the frame. */
const state = { shot: null, own: null, look: {}, arrangement: {}, methods: [], picture: null, recovered: null, seconds: {}, liveCamera: null };
const shotText = new ShotText();

const camera = () => state.own ?? (live.isOn ? state.liveCamera : pathCamera(timeline.frame));
function pathCamera(frame) {
  return state.shot?.path[frame - state.shot.first_frame] ?? state.shot?.path.at(-1);
}
/** The members of a view message that say what is seen. */
const seen = () => ({ frame: timeline.frame, camera: state.own ?? undefined });

function say(text) {
  element("status").textContent = text;
  element("status").title = text;  // two lines of it are shown
}

const connection = new Connection({
  open: () => say(""),
  close: () => {
    view.underWay.clear();
    if (playback.playing) actions.play();
    say("The connection to the server is lost. Trying again. If the server has ended, start raystage replay again and open the address that it prints.");
  },
  picture: (header, jpeg) => {
    if (header.content === "view" || header.content === "comparison") {
      playback.passed(header.id);
      if (header.quality === "playing") playback.receive(header, jpeg);
      else if (live.isOn === (header.quality === "live")) view.receive(header, jpeg);
    }
    if (header.content === "live" && live.isOn) sources.draw({ header, jpeg });
  },
  message: (message) => {
    if (message.type === "hello") {
      state.methods = message.methods;
      document.body.dataset.folder = message.folder;
      comparison.update();
      // After a lost connection the page goes on with what it shows.
      if (live.isOn) return;
      if (state.shot) return sendShot();
      if (message.live !== undefined) followLive(message.live);
      else if (message.list !== undefined) folder.show(message.list);
      document.body.classList.toggle("without-shot", message.list !== undefined);
    } else if (message.type === "ranges") {
      state.rangesMessage = message;
      showRanges();
    } else if (message.type === "progress") {
      showProgress(message);
    } else if (message.type === "shot") {
      showShot(message);
    } else if (message.type === "dropped") {
      element("progress-row").hidden ||= view.underWay.has(message.id);
      view.failed(message.id);
      playback.failed(message.id);
    } else if (message.type === "error") {
      element("progress-row").hidden ||= view.underWay.has(message.id);
      view.failed(message.id);
      if (playback.playing && playback.underWay.has(message.id)) actions.play();
      say(errorText(message));
    }
  },
});

const view = new View(element("stage"), element("picture"), element("guides"), {
  request: (quality) => state.shot && !live.isOn && {
    ...seen(), ...state.arrangement, width: view.width, height: view.height, quality, look: state.look,
    comparison: quality === "resting" ? comparison.member() : undefined, subject: quality === "resting" && state.subject || undefined,
  },
  send: (members) => connection.send("view", members),
  compared: () => [state.shot?.layers.find(({ method }) => method)?.method ?? "This shot", comparison.label()],
  shown: {
    picture: (header) => {
      panels.showFacts(header);
      showRanges();
    },
    resized: () => drawGuides(element("guides"), element("guides-kind").value, state.shot),
  },
});

const playback = new Playback({
  send: (frame) => view.requestPlaying(frame),
  show: (header, bitmap) => view.showPlaying(header, bitmap),
  go: (frame) => timeline.go(frame, "playing"),
  ended: () => {
    timeline.go(timeline.speed > 0 ? timeline.out : timeline.in, "playing");
    timeline.stop();
    showPlayButton();
  },
});
const timeline = new Timeline(element("timeline"), {
  notes: () => notes?.frames() ?? [],
  keys: () => shotText.json ? shotText.keys().map((key) => key.frame) : [],
  playback,
  timeKeys: () => shotText.json ? shotText.timeKeyFrames() : [],
  moveKey: (from, to, isContinued) => state.shot && shotText.moveKey(from, to, isContinued) && (sendShot(), true),
  changed: (frame, quality) => {
    if (quality === "resting") view.rest();
    else if (!timeline.playing) view.move();
    sources.refresh();
    if (quality === "playing") panels.refreshSoon();
    else panels.refresh();
  },
});

const sources = new Sources(element("sources"), element("epi"), {
  ask: (type, members) => connection.ask(type, members),
  request: seen, say,
  chosen: (mode, id) => {
    element("mosaic").textContent = mode === "view" ? "Mosaic" : "Virtual view";
    say(mode === "source" ? `Camera ${id}. Click to return to all cameras.` : "");
  },
});
const comparison = new Comparison(
  { kind: element("compare"), file: element("compare-file"), wipe: element("wipe"), keep: element("keep") },
  { shotText, methods: () => state.methods, changed: () => view.rest(), say, setWipe: (share) => view.setWipe(share) });
const files = new Files(element("file-dialog"), {
  isOpen: () => state.shot !== null, isRecoveryOpen: () => state.recovered !== null,
  ask: (type, members) => connection.ask(type, members),
  shotText, say, saved: () => panels.refresh(),
  request: (frame) => ({ ...seen(), ...state.arrangement, look: state.look, frame }),
});
const folder = new Folder(element("cards"), {
  ask: (type, members) => connection.ask(type, members), say,
  open: (file) => files.attempt(() => connection.ask("open", { file })),
  live: (file) => followLive(file),
});
const live = new Live(element("live"), {
  connection, view, sources, say,
  camera: () => state.own, look: () => state.look,
  ended: () => {
    sources.mode = "view";
    sources.canvas.hidden = true;
    folder.show(live.file.includes("/") ? live.file.replace(/\/[^/]*$/, "") : ".");
  },
});
const notes = new Notes(element("notes"), element("note"), {
  ask: (type, members) => connection.ask(type, members), say,
  file: () => shotText.file, frame: () => timeline.frame,
  go: (frame) => timeline.go(frame), changed: () => timeline.draw(),
});

function followLive(file) {
  folder.hide();
  if (timeline.playing) actions.play();
  if (state.shot && shotText.isChanged()) files.keep();
  connection.send("cancel", {});
  shotText.close();
  state.shot = null;
  state.own = null;
  state.liveCamera = null;
  element("title").textContent = file;
  document.title = file + " - Raystage";
  sources.canvas.hidden = false;
  sources.mode = "live";
  document.body.classList.remove("without-shot");
  element("live").closest("details").open = true;
  element("map").closest("details").open = false;
  live.showMosaic(true);
  live.start(file);
}

function showProgress({ id, share }) {
  if (!view.underWay.has(id)) return;  // it was cancelled, or is complete
  state.estimated = id;
  element("progress-row").hidden = false;
  element("progress").value = share;
}

/** Shows the ranges of motion that came last once their picture is shown, unless the view has moved since. */
function showRanges() {
  if (!state.rangesMessage || view.wanted || view.underWay.size > 0) return;
  if (state.rangesMessage.id === state.picture?.id) panels.showRanges(state.rangesMessage);
}

function setCamera(next, inputTime = performance.now()) {
  if (!camera()) return;
  state.own = next;
  if (live.isOn) live.hurry?.();
  else view.move(inputTime);
  panels.refreshSoon();
}

// The shot.

function showShot(message) {
  state.nested = state.rangesMessage = null;
  if (message.is_opened && message.id === 0 && state.shot) return;  // the first shot, after a lost connection
  if (message.is_opened) {
    const unsaved = state.shot && shotText.isChanged() ? { file: shotText.file, text: shotText.text() } : null;
    if (unsaved) files.keep();
    shotText.reset(message.file, message.text);
    files.reset();
    state.own = null;
    state.subject = null;
    state.subjectRanges = [];
    notes.reset(message.notes);
    live.stop();
    sources.show("view");
    // What the text was when the page or the program ended.
    const kept = unsaved?.file === message.file ? unsaved.text : message.recovered;
    state.recovered = kept && kept !== message.text ? kept : null;
    element("recovery").hidden = !state.recovered;
  }
  if (message.file !== shotText.file) return sendShot();  // an edit from before the file was opened or renamed
  folder.hide();
  document.body.classList.remove("without-shot");
  state.shot = { ...message, measurements: message.measurements ?? state.shot.measurements };
  timeline.absences = message.absences;
  element("title").textContent = message.name || "Raystage";
  element("title").title = message.name;
  document.title = (message.name || "shot") + " - Raystage";
  timeline.reset(message.first_frame, message.last_frame, message.fps);
  setAspect();
  panels.showLayers();
  panels.refresh();
  // What was said about a value that the user gave stays.
  if (message.is_opened || state.isShotRefused) say("");
  state.isShotRefused = false;
}

/** Fits the picture to the stage: eyes side by side are twice as wide. */
function setAspect() {
  const eyes = state.arrangement.arrangement === "side_by_side" ? 2 : 1;
  view.setAspect(eyes * state.shot.width / state.shot.height);
}

/** Sends the edited shot; the server answers with its path, or an error. */
function sendShot() {
  const frame = timeline.frame;
  connection.ask("shot", { file: shotText.file, text: shotText.text() })
    .then(() => { if (timeline.frame === frame) view.rest(); })
    .catch((error) => {
      if (error.message === kReplaced) return;
      state.isShotRefused = true;
      say(error.message);
      if (timeline.frame === frame) view.rest();  // the server dropped the requests before
    });
  panels.refresh();
}

function undo(step) {
  if (!step || !state.shot) return;
  state.own = null;
  sendShot();
}

function setKey() {
  if (!state.shot) return;
  if (!shotText.canSetKeys()) {
    return say("The camera follows a file, a target, an orbit or a dolly zoom. Press Convert to keys first.");
  }
  if (shotText.setKey(timeline.frame, cam.copy(camera()), element("key-what").value)) sendShot();
  state.own = null;
}

/** Moves the key at this frame by frames, and the timeline with it. */
function shiftKey(frames) {
  const from = timeline.frame, to = from + frames;
  if (!state.shot || to < timeline.first || to > timeline.last || !shotText.moveKey(from, to)) return;
  timeline.go(to);
  sendShot();
}

/** Replaces a camera that keys cannot change by keys along the same path. */
async function convertToKeys() {
  if (!state.shot) return;
  const { keys } = await connection.ask("keys", {});
  if (shotText.replaceCamera(keys)) sendShot();
  say(`The camera has ${keys.length} keys now.`);
}

// Focus.

async function focusAt(event) {
  if (!state.shot) return;
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
  if (state.shot && !live.isOn) sources.showEpi(view.pixelAt(event), view);
  if (probeUnderWay || !state.shot || timeline.playing) return;
  probeUnderWay = true;
  const [x, y] = view.pixelAt(event);
  try {
    const found = await connection.ask("probe", {
      frame: timeline.frame, camera: state.own ?? undefined, width: view.width, height: view.height, pixel: [x, y], look: state.look,
    });
    element("readout").textContent = `${Math.floor(x)}, ${Math.floor(y)}   linear ${found.rgba.map((v) => v.toFixed(4)).join(" ")}` +
      `   display ${found.display.join(" ")}   Z ${found.z === null ? "-" : found.z.toFixed(3) + " m"}` +
      (found.coverage === undefined ? "" : `   coverage ${found.coverage.toFixed(2)}`) +
      (found.cameras.length ? "   cameras " + found.cameras.map(([id, share]) => `${id} ${Math.round(100 * share)} %`).join(", ") : "");
  } catch { /* the next pixel may have an answer */ }
  setTimeout(() => { probeUnderWay = false; }, 100);
}

element("stage").addEventListener("pointerleave", () => { element("readout").textContent = ""; });
/** Returns the angle of an orbit, radians, for a drag across the picture: twice across the array, which is all that there is to see. */
function radiansPerWidth() {
  const positions = state.shot?.layers.flatMap((layer) => layer.cameras ?? []).map(({ position }) => position) ?? [];
  const extent = [0, 1, 2].map((axis) => Math.max(...positions.map((p) => p[axis])) - Math.min(...positions.map((p) => p[axis])));
  const size = positions.length > 1 ? Math.max(...extent) : Infinity;
  return Math.min(1.2, 2 * size / cam.focusDistance(camera()));
}

addPointerInput(element("picture"), { camera, radiansPerWidth, setCamera, focusAt, hover, rest: () => { if (!timeline.playing) view.rest(); } });
const cursor = new Cursor(element("cursor"), element("stage"), {
  moved: (event) => sources.mode === "view" && hover(event),
  pressed: (event) => (sources.mode === "view" ? focusAt(event) : sources.click(event)),
});

const panels = makePanels({ state, shotText, timeline, camera, setCamera, sendShot, say, restView: () => view.rest(), changed: () => files.autosave() });
addLook({ state, view, arranged: () => state.shot && setAspect() });

// Buttons and keys.

const stepFrame = (step) => timeline.go(timeline.frame + step);
const actions = {
  undo: () => undo(shotText.undo()), redo: () => undo(shotText.redo()),
  open: () => files.open(), save: () => files.save(), snapshot: () => files.snapshot(timeline.frame), export: () => files.exportCamera(),
  folder: () => {
    if (!element("cards").hidden && (state.shot || live.isOn)) return folder.hide();
    const parent = shotText.file.includes("/") ? shotText.file.replace(/\/[^/]*$/, "") : ".";
    return folder.show(folder.folder ?? parent);
  },
  mosaic: () => (live.isOn ? toggleLiveMosaic() : sources.show(sources.mode === "view" ? "mosaic" : "view")),
  cancel: () => {
    connection.send("cancel", {});
    view.underWay.clear();
    element("progress-row").hidden = true;
  },
  recover: () => {
    element("recovery").hidden = true;
    files.owns(shotText.file);
    const text = state.recovered;
    state.recovered = null;
    let recovered;
    try {
      recovered = JSON.parse(text);
    } catch {
      return say("What was kept is damaged and cannot be recovered.");
    }
    if (shotText.change((json) => replaceContents(json, recovered))) sendShot();
  },
  discard: () => {
    element("recovery").hidden = true;
    state.recovered = null;
    files.autosave();
    files.attempt(() => connection.ask("autosave", { file: shotText.file }));
  },
  "add-note": () => notes.add(),
  headset: () => headset.showOnHeadset({
    camera, frame: () => timeline.frame,
    render: (members) => connection.ask("view", { ...members, look: state.look }),
  }).catch((error) => say("The headset cannot be used: " + error.message)),
  help: () => {
    element("help-dialog").showModal();
    element("help-dialog").scrollTop = 0;  // the focus is on the button at its end
  },
  first: () => timeline.go(timeline.in), last: () => timeline.go(timeline.out),
  back: () => stepFrame(-1), forward: () => stepFrame(1),
  play: () => {
    if (!state.shot && !timeline.playing) return;
    timeline.toggle();
    showPlayButton();
  },
  "to-path": () => {
    const focus = state.own?.focus_m;
    state.own = null;
    view.move();
    panels.refresh();
    if (focus !== undefined && focus !== camera()?.focus_m) say("The focus is that of the shot again. Set key keeps a focus.");
  },
  "set-key": setKey,
  "to-keys": () => files.attempt(convertToKeys),
  "delete-key": () => { if (state.shot && shotText.deleteKey(timeline.frame)) sendShot(); },
  "set-in": () => { timeline.in = Math.min(timeline.frame, timeline.out); timeline.draw(); },
  "set-out": () => { timeline.out = Math.max(timeline.frame, timeline.in); timeline.draw(); },
};
for (const [id, action] of Object.entries(actions)) element(id).addEventListener("click", action);
element("frame").addEventListener("change", (event) => timeline.go(Number(event.target.value)));
element("speed").addEventListener("change", (event) => timeline.setSpeed(Number(event.target.value)));
element("loop").addEventListener("change", (event) => { timeline.loop = event.target.checked; });

function showPlayButton() { element("play").textContent = timeline.playing ? "\u23F8" : "\u25B6"; }

/** Makes a JSON object equal to another one, in place. */
function replaceContents(json, other) {
  for (const name of Object.keys(json)) delete json[name];
  Object.assign(json, other);
}
function toggleLiveMosaic() {
  live.showMosaic(!live.isMosaic);
  element("mosaic").textContent = live.isMosaic ? "Virtual view" : "Mosaic";
}
/** Returns from what covers the view: one camera, the mosaic, the folder; or ends what takes long. */
function escape() {
  if (!element("cards").hidden && (state.shot || live.isOn)) folder.hide();
  else if (sources.mode === "source") sources.show("mosaic");
  else if (sources.mode === "mosaic") sources.show("view");
  else if (!element("progress-row").hidden) actions.cancel();
}
element("epi-on").addEventListener("change", (event) => {
  element("epi").hidden = !event.target.checked;
  view.resize();  // the picture is above it
});
headset.isSupported().then((yes) => { element("headset").hidden = !yes; });

const bindings = [
  ...cameraKeys({ camera, setCamera }),
  ["Home", "Camera of the shot", actions["to-path"]],
  ["Space", "Play or stop", actions.play],
  [",", "One frame back", actions.back],
  [".", "One frame forward", actions.forward],
  ["Shift+< Shift+,", "First frame", actions.first],
  ["Shift+> Shift+.", "Last frame", actions.last],
  ["Alt+ArrowLeft", "Move the cursor; Enter presses at it", () => cursor.move(-1, 0)],
  ["Alt+ArrowRight", "Cursor right", () => cursor.move(1, 0)],
  ["Alt+ArrowUp", "Cursor up", () => cursor.move(0, -1)],
  ["Alt+ArrowDown", "Cursor down", () => cursor.move(0, 1)],
  ["Enter", "Focus, or open the camera, at the cursor", () => cursor.press()],
  ["Ctrl+ArrowLeft", "Move the key one frame back", () => shiftKey(-1)],
  ["Ctrl+ArrowRight", "Move the key one frame on", () => shiftKey(1)],
  ["k", "Set a key", setKey],
  ["Delete", "Delete the key", actions["delete-key"]],
  ["i", "Start of the loop", actions["set-in"]],
  ["o", "End of the loop", actions["set-out"]],
  ["Ctrl+z", "Undo", actions.undo],
  ["Ctrl+Shift+z Ctrl+y", "Redo", actions.redo],
  ["Ctrl+s", "Save", actions.save],
  ["Ctrl+o", "Open", actions.open],
  ["Ctrl+l", "Takes and shots of the folder", actions.folder],
  ["m", "Frames of all cameras", actions.mosaic],
  ["x", "Epipolar-plane image", () => element("epi-on").click()],
  ["Escape", "Back, or cancel", escape],
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
  const { wanted, shown } = playback.statistics;
  element("rate").textContent = `${shown} of ${wanted} frames shown`;
}, 500);

/** For tests and the browser's console: what the page shows and measured. */
globalThis.raystage = { state, view, timeline, playback, shotText, connection, camera, setCamera, sources, comparison, files, folder, live, notes, headset, sendShot };
