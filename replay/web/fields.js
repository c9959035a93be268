// SPDX-License-Identifier: Apache-2.0
// Numeric fields with units.

/** Returns "0.1 to 179 deg", "at least 0.01 m" or "at most 1". */
function rangeText({ min, max, unit }) {
  const range = min === undefined ? `at most ${max}` : max === undefined ? `at least ${min}` : `${min} to ${max}`;
  return range + (unit ? " " + unit : "");
}

/**
 * Adds labelled numbers to an element. specs: [{name, label, unit, step, min, max, get(), set(value)}].
 * Values outside of min and max become the nearest one, and say(text) tells so.
 */
export function addFields(parent, specs, changed, say) {
  const inputs = specs.map((spec) => {
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.type = "number";
    input.step = spec.step ?? "any";
    input.id = spec.name;
    input.dataset.digits = spec.digits ?? 3;
    label.append(`${spec.label}${spec.unit ? ", " + spec.unit : ""}`, input);
    input.addEventListener("change", () => {
      const given = input.value === "" ? undefined : Number(input.value);
      if (given !== undefined && !Number.isFinite(given)) return;
      const { min = -Infinity, max = Infinity } = spec;
      const value = given === undefined ? undefined : Math.min(max, Math.max(min, given));
      if (value !== given) say(`${spec.label} is ${rangeText(spec)}.`);
      spec.set(value);
      input.value = value ?? "";  // also in the field that is being edited
      changed();
    });
    parent.append(label);
    return { input, spec };
  });
  /** Shows the present values, but not in the field that is being edited. */
  return () => {
    for (const { input, spec } of inputs) {
      if (document.activeElement === input) continue;
      const value = spec.get();
      input.value = value === undefined ? "" : Number(value.toFixed(spec.digits ?? 3));
    }
  };
}
