// Writes rows as a file for spreadsheets, with plain numbers and shares in percent; reads the rows of such a file.

/** Returns a share in percent, as it is written into a file. */
export const hundred = (share) => (share === null || share === undefined ? null : 100 * share);

/** Returns the text of a file; null is left blank. */
export const csvText = (rows) => `${rows.map((row) => row.map(cell).join(",")).join("\r\n")}\r\n`;

function cell(value) {
  if (value === null || value === undefined) return "";
  // Digits after the twelfth come from binary fractions.
  const text = typeof value === "number" ? String(Number(value.toPrecision(12))) : inert(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** Returns a text that no spreadsheet runs as a formula: puts an apostrophe before a start that could be one. */
const inert = (text) => (/^[=+\-@\t\r]/.test(text) ? `'${text}` : text);

/** Returns the rows of a text whose cells are separated by `mark`, with the lines where they begin, from 1: `[{line, text, cells}]`. A quoted
 * text is one cell, with its quotes doubled; blank rows are skipped. */
export function csvRows(text, mark) {
  const rows = [];
  let [cells, cell, line, first, from, quoted] = [[], "", 1, 1, 0, false];
  const end = (index) => {
    const whole = text.slice(from, index).trim();
    if (whole !== "") rows.push({ line: first, text: whole, cells: [...cells, cell].map((cell) => cell.trim()) });
    [cells, cell, first, from] = [[], "", line, index + 1];
  };
  // Without quotes each row is a line, which is faster to cut.
  if (!text.includes('"')) {
    for (const [index, row] of text.split("\n").entries()) if (row.trim() !== "") rows.push({ line: index + 1, text: row.trim(), cells: row.split(mark).map((cell) => cell.trim()) });
    return rows;
  }
  for (let index = 0; index < text.length; index++) {
    const letter = text[index];
    if (letter === "\n") line++;
    if (quoted && letter === '"' && text[index + 1] === '"') cell += text[++index];
    else if (letter === '"' && (quoted || cell.trim() === "")) [quoted, cell] = [!quoted, quoted ? cell : ""];
    else if (quoted || (letter !== mark && letter !== "\n")) cell += letter;
    else if (letter === mark) [cells, cell] = [[...cells, cell], ""];
    else end(index);
  }
  end(text.length);
  return rows;
}
