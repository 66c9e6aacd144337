// Points and triangles: .las as loaders.gl reads it, .ply as three.js does.
import { readFileSync } from 'node:fs';
import { parse } from '@loaders.gl/core';
import { LASLoader } from '@loaders.gl/las';
import { PLYLoader } from 'three/examples/jsm/loaders/PLYLoader.js';
import { writeSurface } from './ply.mjs';

function bytesOf(file) {
  const bytes = readFileSync(file);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
}

// Colours of four bytes a point, 0..255.
export async function convertLas(file, out) {
  const { attributes } = await parse(bytesOf(file), LASLoader,
                                     { worker: false, las: { fp64: true, colorDepth: 16 } });
  const rgba = attributes.COLOR_0.value;
  writeSurface(out, attributes.POSITION.value, rgba.filter((_, i) => i % 4 < 3), { type: 'double' });
}

// Colours in linear light, 0..1, of which three.js keeps a byte.
export function convertPly(file, out) {
  const { attributes, index } = new PLYLoader().parse(bytesOf(file));
  const color = Array.from(attributes.color.array, (code) => code / 255);
  writeSurface(out, attributes.position.array, color, { triangles: index?.array });
}
