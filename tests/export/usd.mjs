// OpenUSD text as three.js parses it. It knows no ParticleField, only its attributes.
import { readFileSync } from 'node:fs';
import { USDAParser } from 'three/examples/jsm/loaders/usd/USDAParser.js';
import { writeGaussians } from './ply.mjs';

export function convertUsd(file, out) {
  const specs = new USDAParser().parseData(readFileSync(file, 'utf8')).specsByPath;
  const root = `/${specs['/'].fields.defaultPrim}`;
  if (specs[root].fields.typeName !== 'ParticleField3DGaussianSplat') throw new Error('no Gaussians');
  const value = (name) => specs[`${root}.${name}`].fields.default;
  const coefficients = (value('radiance:sphericalHarmonicsDegree') + 1) ** 2;
  const harmonics = value('radiance:sphericalHarmonicsCoefficients');
  writeGaussians(out, {
    positions: value('positions'), scales: value('scales'), opacities: value('opacities'),
    quats: value('orientations'),  // three.js turns wxyz to xyzw
    coefficients, harmonics: (i, n, c) => harmonics[3 * (coefficients * i + n) + c] });
}
