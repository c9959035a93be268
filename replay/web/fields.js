// SPDX-License-Identifier: Apache-2.0
// Numeric fields with units.

/** Adds labelled numbers to an element. specs: [{name, label, unit, step, get(), set(value), min}]. */
export function addFields(parent, specs, changed) {
  const inputs = specs.map((spec) => {
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.type = "number";
    input.step = spec.step ?? "any";
    input.id = spec.name;
    input.dataset.digits = spec.digits ?? 3;
    label.append(`${spec.label}${spec.unit ? ", " + spec.unit : ""}`, input);
    input.addEventListener("change", () => {
      const value = input.value === "" ? undefined : Number(input.value);
      if (value !== undefined && !Number.isFinite(value)) return;
      spec.set(value);
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
