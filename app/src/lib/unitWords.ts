const POWER = /(?<![A-Za-z_0-9])(s|ms|min|h|m|ft|in|km|rad|deg|g|kg|slug|lb|N|V|A|W|Hz)\^([2-4])(?![0-9A-Za-z_.])/g;
const RAISED: Record<string, string> = { 2: "²", 3: "³", 4: "⁴" };

/** A sentence with the powers of its units above the line, as `flightid.report.unit_words` has them. */
export const raised = (text: string) => text.replace(POWER, (_, unit: string, power: string) => unit + RAISED[power]);

/** A unit as people write it; nothing where there is none. */
export const unitOf = (unit: string) => (unit === "1" ? "" : raised(unit));
