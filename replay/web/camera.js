// SPDX-License-Identifier: Apache-2.0
// A virtual camera: position (metres), orientation (world_from_camera, quaternion w, x, y, z), lens.
// World: right-handed, y up. The camera looks along -z, x to the right.

export const kDefaultFocus = 5;  // metres, where a camera has no focus distance

export const add = (a, b) => a.map((v, i) => v + b[i]);
export const scale = (a, s) => a.map((v) => v * s);
export const norm = (a) => Math.hypot(...a);

export function multiply([aw, ax, ay, az], [bw, bx, by, bz]) {
  return [aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw];
}

export function normalized(q) {
  const length = Math.hypot(...q);
  return q.map((v) => v / length);
}

/** Returns a rotation about a unit axis, angle in radians. */
export function rotation(axis, angle) {
  const s = Math.sin(angle / 2);
  return [Math.cos(angle / 2), axis[0] * s, axis[1] * s, axis[2] * s];
}

export function rotate(q, v) {
  const [, x, y, z] = multiply(multiply(q, [0, ...v]), [q[0], -q[1], -q[2], -q[3]]);
  return [x, y, z];
}

export const right = (camera) => rotate(camera.orientation, [1, 0, 0]);
export const up = (camera) => rotate(camera.orientation, [0, 1, 0]);
export const ahead = (camera) => rotate(camera.orientation, [0, 0, -1]);
export const focusDistance = (camera) => camera.focus_m ?? kDefaultFocus;
export const focusPoint = (camera) => add(camera.position, scale(ahead(camera), focusDistance(camera)));

export function copy(camera) {
  return { ...camera, position: [...camera.position], orientation: [...camera.orientation] };
}

/** Turns the camera about the focus point: azimuth about the world's y axis, elevation about its own x axis; radians. */
export function orbit(camera, azimuth, elevation) {
  const point = focusPoint(camera);
  const moved = copy(camera);
  moved.orientation = normalized(multiply(rotation([0, 1, 0], azimuth),
    multiply(rotation(right(camera), elevation), camera.orientation)));
  moved.position = add(point, scale(ahead(moved), -focusDistance(camera)));
  return moved;
}

/** Moves the camera sideways, metres to its right and upwards. */
export function pan(camera, x, y) {
  const moved = copy(camera);
  moved.position = add(camera.position, add(scale(right(camera), x), scale(up(camera), y)));
  return moved;
}

/** Moves the camera ahead, metres. The focal plane stays where it is. */
export function dolly(camera, distance) {
  const moved = copy(camera);
  moved.position = add(camera.position, scale(ahead(camera), distance));
  if (camera.focus_m !== undefined) moved.focus_m = Math.max(0.01, camera.focus_m - distance);
  return moved;
}

/** Turns the camera about its optical axis, radians, clockwise as the camera sees. */
export function roll(camera, angle) {
  const moved = copy(camera);
  moved.orientation = normalized(multiply(camera.orientation, rotation([0, 0, 1], -angle)));
  return moved;
}

const kDegrees = 180 / Math.PI;

/** Returns azimuth, elevation and roll in degrees: turned in this order about y, x and z. */
export function angles(camera) {
  const back = scale(ahead(camera), -1);
  const azimuth = Math.atan2(back[0], back[2]);
  const elevation = -Math.asin(Math.max(-1, Math.min(1, back[1])));
  const level = multiply(rotation([0, 1, 0], azimuth), rotation([1, 0, 0], elevation));
  const [w, , , z] = multiply([level[0], -level[1], -level[2], -level[3]], camera.orientation);
  return { azimuth: azimuth * kDegrees, elevation: elevation * kDegrees, roll: -2 * Math.atan2(z, w) * kDegrees };
}

export function fromAngles(azimuth, elevation, rollAngle) {
  return normalized(multiply(rotation([0, 1, 0], azimuth / kDegrees),
    multiply(rotation([1, 0, 0], elevation / kDegrees), rotation([0, 0, 1], -rollAngle / kDegrees))));
}

/** Returns the full horizontal angle in degrees. */
export const fieldOfView = (camera) => 2 * Math.atan(camera.film_back_mm / (2 * camera.focal_length_mm)) * kDegrees;
export const focalLength = (filmBack, fov) => filmBack / (2 * Math.tan(fov / kDegrees / 2));

/** Returns metres at the focal plane per pixel of a picture of this width. */
export function metresPerPixel(camera, width) {
  return focusDistance(camera) * camera.film_back_mm / camera.focal_length_mm / width;
}
