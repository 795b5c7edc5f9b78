// Numbers for people: few digits, prefixes of units, steps of 1, 2 and 5.

const PREFIXES = ["n", "µ", "m", "", "k", "M", "G"];

/** "12.3 kN" */
export function withPrefix(value, unit, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const rounded = Number(value.toPrecision(digits));
  const power = Math.max(-3, Math.min(3, Math.floor(Math.log10(Math.abs(rounded)) / 3)));
  return `${Number((rounded / 1000 ** power).toPrecision(digits))} ${PREFIXES[power + 3]}${unit}`;
}

/** "-0.0123", always of the same width as far as that goes: for numbers that change while one looks at them. */
export function plain(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return value.toFixed(Math.max(0, Math.min(4, 3 - Math.floor(Math.log10(size || 1)))));
}

/** The largest of 1, 2, 5, 10, ... that is not above the value. */
export function niceBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].find((step) => step * power <= value * (1 + 1e-9)) * power;
}
