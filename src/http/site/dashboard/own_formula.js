// A field for a strategy of the user's own, stated in a formula.

import { input } from "./form.js";

/** The name that the strategy has in a report. */
const NAME = "Your formula";
/** The name that the service has for the field. */
export const OWN_FIELD = `weights.${NAME}`;

/** Returns `{field, weights()}`: the field, and the part of a request that it gives, empty if it is blank. */
export function ownFormula(note) {
  const field = input({ name: "weights", label: "A formula of your own", inputmode: "text", note: `${note} Such as if(mean12 > bank, 1, 0). Blank: none.` });
  const weights = () => {
    const text = field.control.value.trim();
    return text === "" ? {} : { weights: { [NAME]: text } };
  };
  return { field, weights };
}
