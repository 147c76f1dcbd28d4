/** A number with all digits that it is shown with: 16.0 beside 15.7, where "16" says less than is known. */
export function kept(value: number, digits: number): string {
  const text = value.toPrecision(digits);
  return value === 0 || text.includes("e") ? String(Number(text)) : text;
}
