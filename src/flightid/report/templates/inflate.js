"use strict";
// Gzip unpacked while the caller waits: paper does not wait for the browser's own stream of it.
// RFC 1951; tables by canonical codes as in its section 3.2.2, checked by the length that gzip tells.
const inflated = (() => {
  const LENGTHS = [3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258];
  const DISTANCES = [1, 2, 3, 4, 5, 7, 9, 13, 17, 25, 33, 49, 65, 97, 129, 193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577];
  const ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
  const MOST = 15; // bits of a code

  // By number of bits: how many codes there are, and their symbols in order.
  function codes(bits) {
    const counts = new Uint16Array(MOST + 1), places = new Uint16Array(MOST + 2), symbols = new Uint16Array(bits.length);
    for (const each of bits) counts[each]++;
    counts[0] = 0;
    for (let n = 1; n <= MOST; n++) places[n + 1] = places[n] + counts[n];
    bits.forEach((each, symbol) => { if (each) symbols[places[each]++] = symbol; });
    return { counts, symbols };
  }
  const repeated = (...pairs) => pairs.flatMap(([count, value]) => Array(count).fill(value));
  const FIXED = [codes(repeated([144, 8], [112, 9], [24, 7], [8, 8])), codes(repeated([30, 5]))];

  return (bytes) => {
    const told = new DataView(bytes.buffer, bytes.byteOffset).getUint32(bytes.length - 4, true);
    const made = new Uint8Array(told);
    let at = 10, hold = 0, held = 0, end = 0;
    if (bytes[3]) throw new Error("a gzip with a name or comment is none of ours");
    function take(count) {
      while (held < count) { hold |= bytes[at++] << held; held += 8; }
      const value = hold & ((1 << count) - 1);
      hold >>>= count;
      held -= count;
      return value;
    }
    function symbol({ counts, symbols }) {
      for (let n = 1, code = 0, first = 0, place = 0; n <= MOST; n++) {
        code |= take(1);
        if (code - counts[n] < first) return symbols[place + code - first];
        place += counts[n];
        first = (first + counts[n]) << 1;
        code <<= 1;
      }
      throw new Error("no such code");
    }
    function tables() {
      const [all, far, few] = [take(5) + 257, take(5) + 1, take(4) + 4];
      const small = new Uint8Array(ORDER.length);
      for (let k = 0; k < few; k++) small[ORDER[k]] = take(3);
      const table = codes(small), bits = [];
      while (bits.length < all + far) {
        const next = symbol(table);
        if (next < 16) bits.push(next);
        else if (next === 16) bits.push(...Array(3 + take(2)).fill(bits.at(-1)));
        else bits.push(...Array(next === 17 ? 3 + take(3) : 11 + take(7)).fill(0));
      }
      return [codes(bits.slice(0, all)), codes(bits.slice(all))];
    }
    function block([near, far]) {
      for (let next = symbol(near); next !== 256; next = symbol(near)) {
        if (next < 256) { made[end++] = next; continue; }
        const k = next - 257, j = (k < 8 || k === 28) ? 0 : (k >> 2) - 1;
        const length = LENGTHS[k] + take(j), d = symbol(far);
        const back = DISTANCES[d] + take(d < 4 ? 0 : (d >> 1) - 1);
        for (let n = 0; n < length; n++, end++) made[end] = made[end - back];
      }
    }
    for (let last = 0; !last;) {
      last = take(1);
      const kind = take(2);
      if (kind) block(kind === 1 ? FIXED : tables());
      else {
        [hold, held] = [0, 0];
        const length = bytes[at] | bytes[at + 1] << 8;
        made.set(bytes.subarray(at + 4, at + 4 + length), end);
        at += 4 + length;
        end += length;
      }
    }
    if (end !== told) throw new Error("a part is missing");
    return made;
  };
})();
