// SPDX-License-Identifier: Apache-2.0
// Pointer and keyboard: fly the camera, click to focus.
import { dolly, focusDistance, metresPerPixel, orbit, pan, roll } from "./camera.js";

const kClickDistance = 4;       // pixels that a click may move
const kKeysInFields = new Set(["Ctrl+s", "Ctrl+o", "Ctrl+l"]);  // a field has its own undo

/** controls: {camera(), radiansPerWidth(): of an orbit, dragging across the picture, setCamera(camera, inputTime), focusAt(event), hover(event), rest()}. */
export function addPointerInput(canvas, controls) {
  let last = null, moved = 0;
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus();
    last = event;
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) return controls.hover(event);
    const x = event.clientX - last.clientX, y = event.clientY - last.clientY;
    moved += Math.abs(x) + Math.abs(y);
    if (moved < kClickDistance) return;
    last = event;
    const width = canvas.clientWidth, camera = controls.camera();
    if (!camera) return;
    if (event.shiftKey || event.buttons & 6) {
      const metres = metresPerPixel(camera, width);
      controls.setCamera(pan(camera, -x * metres, y * metres), event.timeStamp);
    } else {
      const radians = controls.radiansPerWidth() / width;
      controls.setCamera(orbit(camera, -x * radians, -y * radians), event.timeStamp);
    }
  });
  canvas.addEventListener("pointerup", (event) => {
    if (last && moved < kClickDistance && event.button === 0) controls.focusAt(event);
    last = null;
    controls.rest();
  });
  canvas.addEventListener("pointercancel", () => { last = null; });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const camera = controls.camera();
    if (!camera) return;
    const steps = Math.max(-3, Math.min(3, -event.deltaY / 100));
    controls.setCamera(dolly(camera, focusDistance(camera) * 0.05 * steps), event.timeStamp);
  }, { passive: false });
}

/** Keys of the page: [keys, description, action]. Keys: "Shift+ArrowLeft", "Ctrl+s". */
export function cameraKeys(controls) {
  const turn = 0.02, step = 0.02, tilt = 0.02;
  const change = (edit) => () => controls.camera() && controls.setCamera(edit(controls.camera()), performance.now());
  const by = (camera) => focusDistance(camera) * step;
  return [
    ["ArrowLeft", "Orbit left", change((c) => orbit(c, -turn, 0))],
    ["ArrowRight", "Orbit right", change((c) => orbit(c, turn, 0))],
    ["ArrowUp", "Orbit up", change((c) => orbit(c, 0, -turn))],
    ["ArrowDown", "Orbit down", change((c) => orbit(c, 0, turn))],
    ["Shift+ArrowLeft", "Pan left", change((c) => pan(c, -by(c), 0))],
    ["Shift+ArrowRight", "Pan right", change((c) => pan(c, by(c), 0))],
    ["Shift+ArrowUp", "Pan up", change((c) => pan(c, 0, by(c)))],
    ["Shift+ArrowDown", "Pan down", change((c) => pan(c, 0, -by(c)))],
    ["PageUp", "Dolly in", change((c) => dolly(c, by(c)))],
    ["PageDown", "Dolly out", change((c) => dolly(c, -by(c)))],
    ["q", "Roll left", change((c) => roll(c, -tilt))],
    ["e", "Roll right", change((c) => roll(c, tilt))],
    ["[", "Focus nearer", change((c) => ({ ...c, focus_m: focusDistance(c) / 1.02 }))],
    ["]", "Focus farther", change((c) => ({ ...c, focus_m: focusDistance(c) * 1.02 }))],
  ];
}

/** Calls the actions of keys, unless a field is edited. Returns nothing. */
export function addKeyboard(bindings) {
  const actions = new Map(bindings.flatMap(([keys, , action]) => keys.split(" ").map((key) => [key, action])));
  addEventListener("keydown", (event) => {
    if (event.target.closest("dialog")) return;
    const isEdited = event.target.matches("input:not([type=range],[type=checkbox]), select");
    const key = event.key === " " ? "Space" : event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const name = (event.ctrlKey || event.metaKey ? "Ctrl+" : "") + (event.altKey ? "Alt+" : "") +
      (event.shiftKey && key !== "?" ? "Shift+" : "") + key;
    if (isEdited && !kKeysInFields.has(name)) return;
    if ((event.key === " " || event.key === "Enter") && event.target.matches("button, summary, input")) return;
    if (event.key.startsWith("Arrow") && event.target.matches("input[type=range]")) return;
    const action = actions.get(name);
    if (!action) return;
    event.preventDefault();
    action();
  });
}
