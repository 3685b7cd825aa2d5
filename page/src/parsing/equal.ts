// Equal keys among many, by a table of hashes: a Map of a million numbers takes ten times as long.

/** For each key of `width` numbers, the place of the first key that is equal. */
export function firstEqual(keys: Int32Array, width: number): Int32Array {
  const count = keys.length / width;
  const slots = new Int32Array(2 ** Math.ceil(Math.log2(2 * count + 1))).fill(-1);
  const first = new Int32Array(count);
  for (let i = 0; i < count; i++) {
    let hash = 0;
    for (let k = 0; k < width; k++) hash = Math.imul(hash ^ keys[width * i + k], 0x9e3779b1) ^ (hash >>> 15);
    let slot = (hash ^ (hash >>> 13)) & (slots.length - 1);
    for (; slots[slot] >= 0; slot = (slot + 1) & (slots.length - 1)) {
      const place = width * slots[slot];
      let same = true;
      for (let k = 0; k < width; k++) same &&= keys[place + k] === keys[width * i + k];
      if (same) break;
    }
    if (slots[slot] < 0) slots[slot] = i;
    first[i] = slots[slot];
  }
  return first;
}
