// SPDX-License-Identifier: Apache-2.0
// How the picture is shown: channel, exposure, display, stereo and guides.
import { drawGuides } from "./view.js";

const element = (id) => document.getElementById(id);
const kDisplays = [["", ""], ["sRGB", "Plain"], ["sRGB", "ACES 1.0 SDR"], ["Rec.1886", "Plain"], ["Rec.1886", "ACES 1.0 SDR"],
  ["P3-D65", "Plain"], ["P3-D65", "ACES 1.0 SDR"]];

/** Connects the controls. app: {state, view, arranged()}; they change state.look and state.arrangement. */
export function addLook({ state, view, arranged }) {
  function changeLook(name, value) {
    if (value === undefined || value === "" || value === false) delete state.look[name];
    else state.look[name] = value;
    view.rest();
  }
  element("channel").addEventListener("change", (event) => changeLook("channel", event.target.value));
  element("exposure").addEventListener("change", (event) => changeLook("exposure", Number(event.target.value) || 0));
  element("black").addEventListener("change", (event) => changeLook("black", event.target.checked));
  element("peaking").addEventListener("change", (event) => changeLook("peaking", event.target.checked));
  for (const [display, name] of kDisplays) element("display").append(new Option(display ? `${display}, ${name}` : "Default", `${display}|${name}`));
  element("display").addEventListener("change", (event) => {
    const [display, name] = event.target.value.split("|");
    changeLook("display", display);
    changeLook("view", name);
  });
  element("arrangement").addEventListener("change", (event) => {
    const value = event.target.value;
    state.arrangement = value === "left" || value === "right" ? { eye: value } : value ? { arrangement: value } : {};
    arranged();
    view.rest();
  });
  element("guides-kind").addEventListener("change", (event) => drawGuides(element("guides"), event.target.value, state.shot));
}
