"use strict";
// The arrays of a run, as `packing.py` wrote them, and the colour maps.

async function readArrays(text, contents) {
  const packed = Uint8Array.from(atob(text.trim()), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const arrays = {};
  for (const [name, entry] of Object.entries(contents)) {
    const size = entry.shape.reduce((a, b) => a * b, 1), row = size / entry.shape[0];
    const whole = new Uint16Array(size), data = new Float32Array(size);
    for (let i = 0; i < size; i++) {
      // Differences in time; 16 bits wrap as they did when they were written.
      whole[i] = (bytes[entry.offset + i] | (bytes[entry.offset + size + i] << 8)) + (i < row ? 0 : whole[i - row]);
      data[i] = entry.low + entry.unit * whole[i];
    }
    arrays[name] = { data, shape: entry.shape };
  }
  return arrays;
}

const COLOUR_MAPS = {
  viridis: ["#440154", "#472c7a", "#3b518b", "#2c718e", "#21908d", "#27ad81", "#5cc863", "#aadc32", "#fde725"],
  balance: ["#053061", "#2166ac", "#4393c3", "#92c5de", "#f7f7f7", "#f4a582", "#d6604d", "#b2182b", "#67001f"],
};

function colourTable(name) {
  const stops = COLOUR_MAPS[name].map(hex => [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16)));
  const table = new Uint8Array(4 * 256);
  for (let i = 0; i < 256; i++) {
    const place = (i / 255) * (stops.length - 1), k = Math.min(stops.length - 2, Math.floor(place));
    for (let c = 0; c < 3; c++) table[4 * i + c] = stops[k][c] + (place - k) * (stops[k + 1][c] - stops[k][c]);
    table[4 * i + 3] = 255;
  }
  return table;
}

const gradient = (name, direction) => `linear-gradient(${direction}, ${COLOUR_MAPS[name].join(", ")})`;

function drawKymograph(canvas, array, field) {
  const [instants, places] = array.shape, table = colourTable(field.map), pen = canvas.getContext("2d");
  canvas.width = instants;
  canvas.height = places;
  const image = pen.createImageData(instants, places), factor = 255 / (field.high - field.low || 1);
  for (let f = 0; f < instants; f++) {
    for (let k = 0; k < places; k++) {
      const value = Math.max(0, Math.min(255, Math.round(factor * (array.data[f * places + k] - field.low))));
      image.data.set(table.subarray(4 * value, 4 * value + 4), 4 * ((places - 1 - k) * instants + f));
    }
  }
  pen.putImageData(image, 0, 0);
}
