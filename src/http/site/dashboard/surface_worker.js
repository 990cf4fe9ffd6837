// Reads a policy's document and computes its surface, off the page's main thread.
//
// The first message is `{address, headers}`, answered by `{ready}`, what is held now. Each later message requests a
// picture, answered by `{picture}`, or with `means` the holdings at them, answered by `{curve}`. A failure of any is
// `{failed}`, in words.

import { Shape, retention } from "./laws.js";
import { curve, heldNow, picture } from "./surface_picture.js";

let policy;
let shape;
const surfaces = new Map();

async function load({ address, headers }) {
  const response = await fetch(address, { headers });
  if (!response.ok) {
    const problem = await response.json().catch(() => ({}));
    throw new Error(problem.detail ?? `The service answered ${response.status}.`);
  }
  policy = await response.json();
  const { history, learning } = policy.specification.problem;
  shape = new Shape(history, retention(learning));
  return { ready: heldNow(policy, shape) };
}

addEventListener("message", async ({ data }) => {
  try {
    if (data.address) postMessage(await load(data));
    else if (data.means) postMessage({ curve: curve(policy, shape, data) });
    else postMessage({ picture: picture(policy, shape, surfaces, data) });
  } catch (error) {
    postMessage({ failed: error.message });
  }
});
