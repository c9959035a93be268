// SPDX-License-Identifier: Apache-2.0
// A stereo view on a headset by WebXR. The server renders both eyes side by side for the latest pose of the
// head; until the next picture comes, the latest one stays where it was in space, at the focal plane.
import * as cam from "./camera.js";
import { decodePicture } from "./picture.js";

const kMinFieldOfView = 100;  // degrees, of pictures: wider than the display, as the head turns meanwhile

/** Returns the camera for a pose of the head relative to the start: `position` (metres) and `orientation` (w, x, y, z). */
export function headCamera(base, position, orientation) {
  const camera = cam.copy(base);
  camera.position = cam.add(base.position, cam.rotate(base.orientation, position));
  camera.orientation = cam.normalized(cam.multiply(base.orientation, orientation));
  camera.focal_length_mm = cam.focalLength(camera.film_back_mm, kMinFieldOfView);
  camera.focus_m = cam.focusDistance(base);
  return camera;
}

/** Returns the corners of a picture at its focal plane, relative to the head at the start, as x, y, z, u, v. */
export function pictureCorners(base, camera, aspect) {
  const inverse = [base.orientation[0], ...base.orientation.slice(1).map((v) => -v)];
  const distance = cam.focusDistance(camera), half = distance * Math.tan(cam.fieldOfView(camera) * Math.PI / 360);
  const vertices = [];
  for (const [x, y] of [[-1, -1], [1, -1], [-1, 1], [1, 1]]) {
    const inWorld = cam.add(camera.position, cam.rotate(camera.orientation, [x * half, y * half / aspect, -distance]));
    const inStart = cam.rotate(inverse, cam.add(inWorld, cam.scale(base.position, -1)));
    vertices.push(...inStart, (x + 1) / 2, (1 - y) / 2);
  }
  return vertices;
}

const kVertexShader = `attribute vec3 position; attribute vec2 place; uniform mat4 projection, view; uniform float eye; varying vec2 at;
void main() { at = vec2((place.x + eye) * 0.5, place.y); gl_Position = projection * view * vec4(position, 1.0); }`;
const kFragmentShader = "precision mediump float; uniform sampler2D picture; varying vec2 at; void main() { gl_FragColor = texture2D(picture, at); }";

function makeProgram(gl) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, kVertexShader], [gl.FRAGMENT_SHADER, kFragmentShader]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}

export async function isSupported() {
  try {
    return Boolean(await navigator.xr?.isSessionSupported("immersive-vr"));
  } catch {
    return false;
  }
}

/** Shows the light field on the headset until the user ends it. options: {camera(), frame(), render(members): {jpeg}}. */
export async function showOnHeadset(options) {
  const session = await navigator.xr.requestSession("immersive-vr");
  const gl = document.createElement("canvas").getContext("webgl", { xrCompatible: true });
  await session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl) });
  const start = await session.requestReferenceSpace("local");
  const base = cam.copy(options.camera()), size = { width: 2048, height: 1024 }, program = makeProgram(gl);
  const buffer = gl.createBuffer(), texture = gl.createTexture();
  let shown = null, waiting = false;

  async function request(pose) {
    waiting = true;
    const { position: p, orientation: q } = pose.transform;
    const camera = headCamera(base, [p.x, p.y, p.z], [q.w, q.x, q.y, q.z]);
    try {
      const { jpeg } = await options.render({ camera, frame: options.frame(), arrangement: "side_by_side", quality: "moving", ...size });
      const bitmap = await decodePicture(jpeg);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, bitmap.source);
      for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      bitmap.close();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(pictureCorners(base, camera, size.width / 2 / size.height)), gl.DYNAMIC_DRAW);
      shown = camera;
    } catch { /* a newer request replaced this one */ }
    waiting = false;
  }

  session.requestAnimationFrame(function draw(_, frame) {
    session.requestAnimationFrame(draw);
    const pose = frame.getViewerPose(start);
    if (!pose) return;
    if (!waiting) request(pose);
    const layer = session.renderState.baseLayer;
    gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!shown) return;
    gl.useProgram(program);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    for (const [name, count, offset] of [["position", 3, 0], ["place", 2, 12]]) {
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 20, offset);
    }
    for (const view of pose.views) {
      const { x, y, width, height } = layer.getViewport(view);
      gl.viewport(x, y, width, height);
      gl.uniformMatrix4fv(gl.getUniformLocation(program, "projection"), false, view.projectionMatrix);
      gl.uniformMatrix4fv(gl.getUniformLocation(program, "view"), false, view.transform.inverse.matrix);
      gl.uniform1f(gl.getUniformLocation(program, "eye"), view.eye === "right" ? 1 : 0);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
  });
  return session;
}
