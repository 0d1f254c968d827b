// A page begins here: unpack the viewer and run it. The page's policy allows this script by its hash, and no other.

import { bytesOf, inflated } from "./letters.js";

async function begin() {
  if (!globalThis.DecompressionStream) throw new Error("this browser is too old. Update it");
  const packed = document.getElementById("viewer"), script = document.createElement("script");
  script.textContent = await inflated(bytesOf(packed.textContent)).text();
  packed.replaceWith(script);
}

begin().catch((error) => {
  document.getElementById("message").textContent = `This page cannot be shown: ${error.message}`;
});
