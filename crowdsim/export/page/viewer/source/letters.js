// Bytes as text of a page: their number, a space, and three letters for each 47 bits, the highest first.

const LETTERS = 52016, FIRST = 0x0c00; // how many letters there are, and the letter for 0
const LOW_BITS = 23, LOW = 2 ** LOW_BITS; // of a group; 24 more are above them

/** The bytes that a text holds. */
export function bytesOf(text) {
  const first = text.indexOf(" ") + 1, bytes = new Uint8Array(Number(text.slice(0, first)));
  let held = 0, bits = 0, at = 0;
  const take = (value, more) => {
    held = (held << more) | value;
    for (bits += more; bits >= 8; ) {
      bits -= 8;
      bytes[at++] = (held >> bits) & 255; // what lies beyond the last byte is dropped
    }
    held &= (1 << bits) - 1;
  };
  const digit = (k) => text.charCodeAt(k) - FIRST;
  for (let k = first; at < bytes.length; k += 3) {
    const value = (digit(k) * LETTERS + digit(k + 1)) * LETTERS + digit(k + 2);
    take(Math.floor(value / LOW), 24);
    take(value % LOW, LOW_BITS);
  }
  return bytes;
}

/** What compressed bytes hold. */
export function inflated(bytes) {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
}
