// Bytes as text of a page: their number, a space, and a letter for each 15 bits, the highest first.

const BITS = 15, FIRST = 0x4000; // bits of a letter, and the letter for 0

/** The bytes that a text holds. */
export function bytesOf(text) {
  const first = text.indexOf(" ") + 1, bytes = new Uint8Array(Number(text.slice(0, first)));
  let held = 0, bits = 0, at = 0;
  for (let k = first; at < bytes.length; k++) {
    held = (held << BITS) | (text.charCodeAt(k) - FIRST);
    bits += BITS;
    while (bits >= 8 && at < bytes.length) {
      bits -= 8;
      bytes[at++] = (held >> bits) & 255;
    }
    held &= (1 << bits) - 1;
  }
  return bytes;
}

/** What compressed bytes hold. */
export function inflated(bytes) {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
}
