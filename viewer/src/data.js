// A run as the Python package packs it: a description in JSON beside one block of numbers, deflated and in base64.

const KINDS = { float64: Float64Array, float32: Float32Array, int16: Int16Array, uint8: Uint8Array };

/** Description with its arrays in place, by name: `{ shape, values }`. */
export async function unpack(text) {
  const { description, block } = JSON.parse(text);
  const stream = new Blob([bytesOf(block)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return withArrays(description, await new Response(stream).arrayBuffer());
}

/** The same with the block as it is, from a widget. */
export function withArrays(description, buffer) {
  const arrays = {};
  for (const { name, dtype, shape, offset } of description.arrays) {
    const size = shape.reduce((product, n) => product * n, 1);
    arrays[name] = { shape, values: new KINDS[dtype](buffer, offset, size) };
  }
  return { ...description, arrays };
}

/** Values of one frame of an array whose first axis is the frames. */
export function frameOf({ shape, values }, frame) {
  const width = values.length / shape[0];
  return values.subarray(frame * width, (frame + 1) * width);
}

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
}
