#!/usr/bin/env node
// Reads a file of Gaussians, or a .glb of triangles, with programs of others and writes what they
// found as a .ply.
// convert.mjs FILE OUT.ply; exit code 3: none of them knows the format.
import { spawnSync } from 'node:child_process';
import { createRequire } from 'node:module';
import { readFileSync, writeFileSync } from 'node:fs';

const SPLAT_TRANSFORM = ['.ply', '.spz', '.sog', '.splat'];

function bySplatTransform(file, out) {
  const entry = new URL('node_modules/@playcanvas/splat-transform/bin/cli.mjs', import.meta.url);
  const run = spawnSync(process.execPath, [entry.pathname, '--quiet', '-w', file, out],
                        { encoding: 'utf8' });
  process.stderr.write(run.stderr ?? '');
  return run.status ?? 1;
}

async function byGltfTransform(file, out) {
  const { NodeIO } = await import('@gltf-transform/core');
  const document = await new NodeIO().readBinary(new Uint8Array(readFileSync(file)));
  const primitive = document.getRoot().listMeshes()[0].listPrimitives()[0];
  return primitive.getIndices() ? writeTriangles(primitive, out) : writeGaussians(primitive, out);
}

// Colours stay in linear light, as floats.
function writeTriangles(primitive, out) {
  const position = primitive.getAttribute('POSITION'), color = primitive.getAttribute('COLOR_0');
  const count = position.getCount(), indices = primitive.getIndices().getArray();
  const names = ['x', 'y', 'z', 'red', 'green', 'blue'];
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n` +
      names.map((name) => `property float ${name}\n`).join('') +
      `element face ${indices.length / 3}\nproperty list uchar int vertex_indices\nend_header\n`;
  const vertices = new Float32Array(6 * count);
  for (let i = 0; i < count; i++) {
    vertices.set([...position.getElement(i, []), ...color.getElement(i, []).slice(0, 3)], 6 * i);
  }
  const faces = Buffer.alloc(13 * indices.length / 3);
  for (let i = 0; i < indices.length; i++) {
    if (i % 3 === 0) faces.writeUInt8(3, 13 * i / 3);
    faces.writeInt32LE(indices[i], 13 * Math.floor(i / 3) + 1 + 4 * (i % 3));
  }
  writeFileSync(out, Buffer.concat([Buffer.from(header), Buffer.from(vertices.buffer), faces]));
  return 0;
}

// glTF's values are activated, those of a .ply are not.
function writeGaussians(primitive, out) {
  const array = (name) => primitive.getAttribute(name).getArray();
  const splat = (name) => array(`KHR_gaussian_splatting:${name}`);
  const count = primitive.getAttribute('POSITION').getCount();
  const columns = [];
  const add = (name, value) => columns.push([name, value]);
  const [position, scale, quat, opacity] =
      [array('POSITION'), splat('SCALE'), splat('ROTATION'), splat('OPACITY')];
  ['x', 'y', 'z'].forEach((name, k) => add(name, (i) => position[3 * i + k]));
  const harmonics = [];
  for (let degree = 0; degree <= 3; degree++) {
    for (let n = 0; n <= 2 * degree; n++) {
      const name = `KHR_gaussian_splatting:SH_DEGREE_${degree}_COEF_${n}`;
      if (primitive.getAttribute(name)) harmonics.push(array(name));
    }
  }
  for (let c = 0; c < 3; c++) add(`f_dc_${c}`, (i) => harmonics[0][3 * i + c]);
  const rest = harmonics.length - 1;
  for (let at = 0; at < 3 * rest; at++) {
    const values = harmonics[1 + (at % rest)], c = Math.floor(at / rest);
    add(`f_rest_${at}`, (i) => values[3 * i + c]);
  }
  add('opacity', (i) => {
    const inside = Math.min(1 - 1e-6, Math.max(1e-6, opacity[i]));
    return Math.log(inside / (1 - inside));
  });
  for (let k = 0; k < 3; k++) add(`scale_${k}`, (i) => Math.log(scale[3 * i + k]));
  for (let k = 0; k < 4; k++) add(`rot_${k}`, (i) => quat[4 * i + ((k + 3) % 4)]);  // wxyz
  const names = columns.map(([name]) => `property float ${name}\n`).join('');
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${names}end_header\n`;
  const data = new Float32Array(count * columns.length);
  for (let i = 0; i < count; i++) {
    columns.forEach(([, value], k) => { data[i * columns.length + k] = value(i); });
  }
  writeFileSync(out, Buffer.concat([Buffer.from(header), Buffer.from(data.buffer)]));
  return 0;
}

// A glTF file that the validator finds an error in is not read.
async function validate(file) {
  const validator = createRequire(import.meta.url)('gltf-validator');
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)));
  // It does not know the extension, so it takes the names of its attributes for errors.
  const errors = report.issues.messages.filter((message) => message.severity === 0 &&
      !(message.code === 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' &&
        message.pointer.includes('/KHR_gaussian_splatting:')));
  for (const message of errors) {
    console.error(`${message.code} ${message.pointer}: ${message.message}`);
  }
  return errors.length;
}

const [file, out] = process.argv.slice(2);
if (file.endsWith('.glb')) {
  process.exit((await validate(file)) ? 1 : await byGltfTransform(file, out));
}
process.exit(SPLAT_TRANSFORM.some((ending) => file.endsWith(ending)) ? bySplatTransform(file, out) : 3);
