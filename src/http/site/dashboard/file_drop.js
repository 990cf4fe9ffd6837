// A text file, chosen or dropped.

import { h } from "./dom.js";

/** Returns the text of a file: UTF-16 if its first bytes say so, else UTF-8, else Windows-1252, which spreadsheets in Europe save. */
async function content(file) {
  const bytes = await file.arrayBuffer();
  const [first, second] = new Uint8Array(bytes);
  const wide = { "255 254": "utf-16le", "254 255": "utf-16be" }[`${first} ${second}`];
  try {
    return new TextDecoder(wide ?? "utf-8", { fatal: true }).decode(bytes);
  } catch {
    return new TextDecoder(wide ?? "windows-1252").decode(bytes);
  }
}

/** Returns the zone where a file is chosen or dropped; `open(text)` takes its text. `id` is that of the field that shows the text. */
export function fileDrop(id, open) {
  const file = h("input", {
    type: "file",
    id: `${id}-file`,
    accept: ".csv,.tsv,.txt,text/csv,text/plain",
    class: "unseen",
  });
  const opened = async (chosen) => chosen && open(await content(chosen));
  file.addEventListener("change", async () => {
    await opened(file.files[0]);
    // Allows the same file to be chosen again after a change.
    file.value = "";
  });
  const chosen = h("label", { class: "button quiet", for: file.id }, "Choose a CSV file");
  const zone = h("div", { class: "drop" }, h("p", {}, file, chosen, " or drop one here, or paste below."));
  zone.addEventListener("dragover", (event) => {
    event.preventDefault();
    zone.classList.add("over");
  });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    opened(event.dataTransfer.files[0]);
  });
  return zone;
}
