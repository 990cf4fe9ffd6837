// Rows as a file for spreadsheets: numbers plain, shares in percent.

/** A share in percent, as it is written into a file. */
export const hundred = (share) => (share === null || share === undefined ? null : 100 * share);

/** The text of a file; what is null is left blank. */
export const csvText = (rows) => `${rows.map((row) => row.map(cell).join(",")).join("\r\n")}\r\n`;

function cell(value) {
  if (value === null || value === undefined) return "";
  // Beyond twelve digits are those of binary fractions.
  const text = typeof value === "number" ? String(Number(value.toPrecision(12))) : value;
  return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
