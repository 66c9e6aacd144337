// glTF as gltf-transform reads it.
import { createRequire } from 'node:module';
import { readFileSync } from 'node:fs';
import { NodeIO } from '@gltf-transform/core';
import { writeGaussians, writeSurface } from './ply.mjs';

export async function convertGltf(file, out) {
  await validate(file);
  const document = await new NodeIO().readBinary(new Uint8Array(readFileSync(file)));
  const primitive = document.getRoot().listMeshes()[0].listPrimitives()[0];
  if (primitive.getIndices()) writeTriangles(primitive, out);
  else writeSplats(primitive, out);
}

// Colours stay in linear light, as floats.
function writeTriangles(primitive, out) {
  const array = (name) => primitive.getAttribute(name);
  const position = [], color = [];
  for (let i = 0; i < array('POSITION').getCount(); i++) {
    position.push(...array('POSITION').getElement(i, []));
    color.push(...array('COLOR_0').getElement(i, []).slice(0, 3));
  }
  writeSurface(out, position, color, { triangles: primitive.getIndices().getArray() });
}

function writeSplats(primitive, out) {
  const array = (name) => primitive.getAttribute(name)?.getArray();
  const splat = (name) => array(`KHR_gaussian_splatting:${name}`);
  const harmonics = [];
  for (let degree = 0; degree <= 3; degree++) {
    for (let n = 0; n <= 2 * degree; n++) {
      const values = splat(`SH_DEGREE_${degree}_COEF_${n}`);
      if (values) harmonics.push(values);
    }
  }
  writeGaussians(out, {
    positions: array('POSITION'), scales: splat('SCALE'), opacities: splat('OPACITY'),
    quats: splat('ROTATION'),
    coefficients: harmonics.length, harmonics: (i, n, c) => harmonics[n][3 * i + c] });
}

// Throws where the validator finds an error.
async function validate(file) {
  const validator = createRequire(import.meta.url)('gltf-validator');
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)));
  // It does not know the extension, so it takes the names of its attributes for errors.
  const errors = report.issues.messages.filter((message) => message.severity === 0 &&
      !(message.code === 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' &&
        message.pointer.includes('/KHR_gaussian_splatting:')));
  if (errors.length) {
    throw new Error(errors.map((e) => `${e.code} ${e.pointer}: ${e.message}`).join('\n'));
  }
}
