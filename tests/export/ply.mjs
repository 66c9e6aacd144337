// Writes what programs of others found as a .ply.
import { writeFileSync } from 'node:fs';

const BYTES = { float: 4, double: 8 };

// Values of one type, a row for each of `count` elements; triangles by their corners, if any.
// `columns`: [name, value of an element]...
export function writePly(out, count, columns, { type = 'float', triangles = [] } = {}) {
  const width = BYTES[type] * columns.length;
  const rows = Buffer.alloc(width * count);
  const write = (type === 'float' ? rows.writeFloatLE : rows.writeDoubleLE).bind(rows);
  for (let i = 0; i < count; i++) {
    columns.forEach(([, value], k) => write(value(i), width * i + BYTES[type] * k));
  }
  const faces = Buffer.alloc(13 * (triangles.length / 3));
  for (let i = 0; i < triangles.length; i++) {
    if (i % 3 === 0) faces.writeUInt8(3, 13 * (i / 3));
    faces.writeInt32LE(triangles[i], 13 * Math.floor(i / 3) + 1 + 4 * (i % 3));
  }
  const header = 'ply\nformat binary_little_endian 1.0\n' +
      `element vertex ${count}\n${columns.map(([name]) => `property ${type} ${name}\n`).join('')}` +
      (triangles.length ? `element face ${triangles.length / 3}\nproperty list uchar int vertex_indices\n` : '') +
      'end_header\n';
  writeFileSync(out, Buffer.concat([Buffer.from(header), rows, faces]));
}

// Points or corners of triangles: `position` and `color` hold three values of each.
export function writeSurface(out, position, color, options = {}) {
  const columns = [...['x', 'y', 'z'].map((name, k) => [name, (i) => position[3 * i + k]]),
                   ...['red', 'green', 'blue'].map((name, k) => [name, (i) => color[3 * i + k]])];
  writePly(out, position.length / 3, columns, options);
}

// Gaussians as glTF and OpenUSD have them: values activated, which those of a .ply are not.
// `quats` in the order xyzw; harmonics(i, n, c): coefficient n of `coefficients`, channel c.
export function writeGaussians(out, { positions, scales, quats, opacities, coefficients, harmonics }) {
  const columns = [];
  const add = (name, value) => columns.push([name, value]);
  ['x', 'y', 'z'].forEach((name, k) => add(name, (i) => positions[3 * i + k]));
  for (let c = 0; c < 3; c++) add(`f_dc_${c}`, (i) => harmonics(i, 0, c));
  const rest = coefficients - 1;
  for (let at = 0; at < 3 * rest; at++) {
    add(`f_rest_${at}`, (i) => harmonics(i, 1 + (at % rest), Math.floor(at / rest)));
  }
  add('opacity', (i) => {
    const inside = Math.min(1 - 1e-6, Math.max(1e-6, opacities[i]));
    return Math.log(inside / (1 - inside));
  });
  for (let k = 0; k < 3; k++) add(`scale_${k}`, (i) => Math.log(scales[3 * i + k]));
  for (let k = 0; k < 4; k++) add(`rot_${k}`, (i) => quats[4 * i + ((k + 3) % 4)]);  // wxyz
  writePly(out, positions.length / 3, columns);
}
