/** Counts changes of a study that a field has asked for and that were not stored. */
class Unstored {
  times = $state(0);
}
export const unstored = new Unstored();

/** Of each field, how often that was when it was looked at: half a number that is typed stays. */
const seen = new WeakMap<Element, number>();

/**
 * A field shows what stands, also where a change of it was not stored: nothing that it is told has
 * changed then, and it would go on showing what a hand has chosen.
 */
export const stands = (value: string | number | boolean) => (field: HTMLSelectElement | HTMLInputElement) => {
  const before = seen.get(field) ?? unstored.times;
  seen.set(field, unstored.times);
  if (before === unstored.times) return;
  if (typeof value === "boolean") (field as HTMLInputElement).checked = value;
  else field.value = String(value);
};
