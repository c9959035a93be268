// SPDX-License-Identifier: Apache-2.0
// Plan (from above) and elevation (from the right): cameras of the array, fisheyes with their axes and half angles, the
// range of motion of the view, the virtual camera with its field of view and focal plane, and its path.
import { add, ahead, fieldOfView, focusDistance, right, scale, up } from "./camera.js";

/** `axes`: for each of plan and elevation, the world's axes to the right and up on the map. */
const kPanels = [
  { title: "Plan", across: [1, 0, 0], upwards: [0, 0, -1] },
  { title: "Elevation", across: [0, 0, -1], upwards: [0, 1, 0] },
];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Returns the convex outline of points in a plane (Andrew 1979). */
function outline(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const side = (ordered) => {
    const kept = [];
    for (const point of ordered) {
      while (kept.length > 1 && turn(kept.at(-2), kept.at(-1), point) <= 0) kept.pop();
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...side(sorted), ...side(sorted.reverse())];
}

/** Adds the area that the triangles of a surface cover on a panel to the path. */
function addSilhouette(context, { vertices, triangles }, at) {
  const points = vertices.map(at);
  for (const triangle of triangles) {
    let [a, b, c] = triangle.map((i) => points[i]);
    // Areas that are traced in opposite directions would cancel each other.
    if ((b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])) [b, c] = [c, b];
    context.moveTo(...a);
    context.lineTo(...b);
    context.lineTo(...c);
    context.closePath();
  }
}

/** Adds the axis of a fisheye to the path, `length` metres long, and the ends of rays as long at its half angle. */
function addFisheye(context, fisheye, length, at) {
  const axes = [ahead(fisheye), right(fisheye), up(fisheye)];
  const end = (...parts) => at(parts.reduce((place, part, i) => add(place, scale(axes[i], length * part)), fisheye.position));
  context.moveTo(...at(fisheye.position));
  context.lineTo(...end(1, 0, 0));
  const kSides = 24, along = Math.cos(fisheye.half_angle), across = Math.sin(fisheye.half_angle);
  for (let i = 0; i <= kSides; ++i) {
    const turn = 2 * Math.PI * i / kSides, rim = end(along, across * Math.cos(turn), across * Math.sin(turn));
    i ? context.lineTo(...rim) : context.moveTo(...rim);
  }
}

/**
 * `ranges`: `simple`: vertices of the convex ranges of motion, known at once; `nested`: surfaces of those of shares of
 * the rays, which replace them; `ofSubject`: surfaces of that of `subject`, a cube.
 */
export function drawMap(canvas, arrayCameras, camera, path, ranges) {
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (!camera) return;
  const points = [...arrayCameras.map((c) => c.position), camera.position];
  const reach = focusDistance(camera);
  const focus = camera.position.map((v, i) => v + ahead(camera)[i] * reach);
  const shown = [...points, ...path.map((c) => c.position)];
  const middle = [0, 1, 2].map((i) => (Math.min(...shown.map((p) => p[i])) + Math.max(...shown.map((p) => p[i]))) / 2);
  // The array fills a third of a panel; the focal plane may be outside.
  const size = Math.max(0.05, ...shown.map((p) => Math.hypot(...p.map((v, i) => v - middle[i]))));
  kPanels.forEach(({ title, across, upwards }, panel) => {
    const top = panel * canvas.height / 2, centerX = canvas.width / 2, centerY = top + canvas.height / 4;
    const perMetre = canvas.height / 4 / (size * 1.6);
    const at = (p) => [centerX + dot(p.map((v, i) => v - middle[i]), across) * perMetre,
      centerY - dot(p.map((v, i) => v - middle[i]), upwards) * perMetre];
    context.save();
    context.beginPath();
    context.rect(0, top, canvas.width, canvas.height / 2 - 2);
    context.clip();
    context.fillStyle = "#191a1c";
    context.fill();
    for (const surface of [...ranges.nested].sort((a, b) => a.share - b.share)) {
      context.beginPath();
      addSilhouette(context, surface, at);
      context.fillStyle = "#3fae9a30";
      context.fill();
    }
    for (const surface of ranges.ofSubject) {
      context.beginPath();
      addSilhouette(context, surface, at);
      context.fillStyle = "#a06ee040";
      context.fill();
    }
    if (ranges.subject) {
      const [x, y] = at(ranges.subject.point), edge = ranges.subject.size_m * perMetre;
      context.strokeStyle = "#c9a6f5";
      context.strokeRect(x - edge / 2, y - edge / 2, edge, edge);
    }
    for (const { vertices } of ranges.nested.length ? [] : ranges.simple) {
      if (vertices.length < 2) continue;
      context.beginPath();
      outline(vertices.map(at)).forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      context.fillStyle = "#3fae9a30";
      context.fill();
      context.strokeStyle = "#3fae9a90";
      context.stroke();
    }
    context.strokeStyle = "#6ea3dc90";
    context.beginPath();
    const kFisheyePixels = 12;
    for (const one of arrayCameras.filter((c) => c.half_angle)) addFisheye(context, one, kFisheyePixels / perMetre, at);
    context.stroke();
    context.fillStyle = "#6ea3dc";
    for (const { position } of arrayCameras) {
      const [x, y] = at(position);
      context.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
    if (path.length > 1) {
      context.strokeStyle = "#8a7440";
      context.beginPath();
      path.forEach(({ position }, i) => (i ? context.lineTo(...at(position)) : context.moveTo(...at(position))));
      context.stroke();
    }
    // The field of view up to the focal plane, horizontally on the plan and vertically on the elevation.
    const half = Math.tan(fieldOfView(camera) * Math.PI / 360) * reach * (panel === 0 ? 1 : 9 / 16);
    const side = panel === 0 ? right(camera) : up(camera);
    const ends = [-half, half].map((h) => focus.map((v, i) => v + side[i] * h));
    context.strokeStyle = "#f0b429";
    context.beginPath();
    context.moveTo(...at(ends[0]));
    context.lineTo(...at(camera.position));
    context.lineTo(...at(ends[1]));
    context.stroke();
    context.setLineDash([4, 3]);
    context.beginPath();
    context.moveTo(...at(ends[0]));
    context.lineTo(...at(ends[1]));
    context.stroke();
    context.setLineDash([]);
    context.fillStyle = "#f0b429";
    context.beginPath();
    context.arc(...at(camera.position), 4, 0, 7);
    context.fill();
    context.fillStyle = "#9a9da3";
    context.font = "11px system-ui";
    context.fillText(title, 6, top + 14);
    if (ranges.nested.length && panel === 0) {
      const shares = [...new Set(ranges.nested.map(({ share }) => 100 * share))].sort((a, b) => b - a);
      context.fillText(`range for ${shares.join(", ")} % of rays`, 40, top + 14);
    }
    context.restore();
  });
}
