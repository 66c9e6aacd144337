#!/usr/bin/env node
// Reads a file of Gaussians, points or triangles with programs of others and writes what they
// found as a .ply.
// convert.mjs FILE OUT.ply; exit code 3: none of them knows the format.
import { spawnSync } from 'node:child_process';
import { convertGltf } from './gltf.mjs';
import { convertLas, convertPly } from './surfaces.mjs';
import { convertUsd } from './usd.mjs';

function bySplatTransform(file, out) {
  const entry = new URL('node_modules/@playcanvas/splat-transform/bin/cli.mjs', import.meta.url);
  const run = spawnSync(process.execPath, [entry.pathname, '--quiet', '-w', file, out],
                        { encoding: 'utf8' });
  if (run.status !== 0) throw new Error(run.stderr);
}

const READERS = [  // the first that fits
  [/\.(mesh|points)\.ply$/, convertPly],
  [/\.(ply|spz|sog|splat)$/, bySplatTransform],
  [/\.glb$/, convertGltf],
  [/\.usda$/, convertUsd],
  [/\.las$/, convertLas],
];

const [file, out] = process.argv.slice(2);
const reader = READERS.find(([ending]) => ending.test(file))?.[1];
if (!reader) process.exit(3);
try {
  await reader(file, out);
} catch (error) {
  console.error(error.message);
  process.exit(1);
}
