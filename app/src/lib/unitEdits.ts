import type { Edit } from "./types";

type Units = Record<string, string> | undefined;
const isEmptied = (units: Units, names: string[]) => Object.keys(units ?? {}).every((each) => names.includes(each));

/**
 * Edits of a study that give channels one unit in all its records from here on: no record keeps a word
 * of its own, and a table of which nothing is left goes too. Empty: nobody says the unit.
 */
export function unitEdits(names: string[], unit: string, all: Units, records: { units?: Record<string, string> }[]): Edit[] {
  const cleared = (units: Units, at: (string | number)[]): Edit[] => {
    const said = names.filter((name) => name in (units ?? {}));
    if (said.length && isEmptied(units, said)) return [{ path: at, value: null }];
    return said.map((name) => ({ path: [...at, name], value: null }));
  };
  const own = records.flatMap((each, k) => cleared(each.units, ["record", k, "units"]));
  const place = ["defaults", "record", "units"];
  return [...own, ...(unit ? names.map((name) => ({ path: [...place, name], value: unit })) : cleared(all, place))];
}

/** Of columns that have a role; what is said of others no study takes. */
export const only = (units: Record<string, string>, names: string[]) => Object.fromEntries(Object.entries(units).filter(([name, unit]) => unit && names.includes(name)));
