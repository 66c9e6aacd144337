// A camera that orbits a point and flies. Axes as in OpenCV: x right, y down, z forward.

export interface Vector { x?: number; y?: number; z?: number }

export interface Camera {
  width: number;
  height: number;
  intrinsics: {fx: number; fy: number; cx: number; cy: number};
  viewmat: {values: number[]};
}

// Of the photos, and what they look at.
export interface Cameras {
  cameras?: {name: string; camera: Camera}[];
  center?: Vector;
  up?: Vector;
  radius?: number;
  iteration?: number;
  gaussians?: string;
}

export type V3 = readonly [number, number, number];

export const add = (a: V3, b: V3, s = 1): V3 => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const dot = (a: V3, b: V3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: V3, b: V3): V3 =>
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: V3): number => Math.hypot(...a);
export const unit = (a: V3): V3 => { const l = length(a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
export const vector = (v?: Vector): V3 => [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0];

// Turns `v` about the unit vector `axis` (Rodrigues' formula).
function turned(v: V3, axis: V3, angle: number): V3 {
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add([c * v[0], c * v[1], c * v[2]], cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

const kNearPole = 0.999;  // no closer to straight up or down

export interface Frame { eye: V3; right: V3; down: V3; forward: V3 }

// Rows of a world-to-camera matrix as a frame.
export function frameOf(camera: Camera): Frame {
  const m = camera.viewmat.values;
  const right: V3 = [m[0]!, m[1]!, m[2]!], down: V3 = [m[4]!, m[5]!, m[6]!];
  const forward: V3 = [m[8]!, m[9]!, m[10]!];
  const eye = add(add(add([0, 0, 0], right, -m[3]!), down, -m[7]!), forward, -m[11]!);
  return {eye, right, down, forward};
}

// The world-to-camera matrix of a frame, 4x4, row-major.
export function viewmatOf(f: Frame): number[] {
  return [f.right, f.down, f.forward].flatMap((axis) => [...axis, -dot(axis, f.eye)])
      .concat([0, 0, 0, 1]);
}

export class OrbitCamera {
  eye: V3 = [0, 0, 0];
  forward: V3 = [0, 0, 1];
  distance = 1;  // to the point that is orbited
  fovDeg = 50;   // vertical
  readonly up: V3;
  readonly radius: number;
  private readonly center: V3;

  constructor(cameras: Cameras) {
    this.up = unit(vector(cameras.up));
    this.radius = cameras.radius || 1;
    this.center = vector(cameras.center);
    const first = cameras.cameras?.[0];
    if (first) this.jump(first.camera);
  }

  // To where a photo was taken.
  jump(camera: Camera): void {
    const frame = frameOf(camera);
    this.eye = frame.eye;
    this.forward = frame.forward;
    this.distance = Math.max(dot(add(this.center, this.eye, -1), this.forward), 0.1 * this.radius);
    this.fovDeg = 2 * Math.atan(camera.height / 2 / camera.intrinsics.fy) * 180 / Math.PI;
  }

  // Of a camera here that looks along `forward`, of unit length.
  frame(forward = this.forward): Frame {
    const right = this.rightOf(forward);
    return {eye: this.eye, right, down: cross(forward, right), forward};
  }

  viewmat(): number[] { return viewmatOf(this.frame()); }

  // Around the point in front, by angles in radians.
  orbit(yaw: number, pitch: number): void {
    const pivot = add(this.eye, this.forward, this.distance);
    this.turn(yaw, pitch);
    this.eye = add(pivot, this.forward, -this.distance);
  }

  // About the eye.
  turn(yaw: number, pitch: number): void {
    const level = turned(this.forward, this.up, -yaw);
    const pitched = turned(level, this.rightOf(level), pitch);
    const steepest = Math.max(kNearPole, Math.abs(dot(level, this.up)));  // photos may look straight down
    this.forward = unit(Math.abs(dot(pitched, this.up)) < steepest ? pitched : level);
  }

  // Along its axes, in shares of the distance.
  move(right: number, down: number, forward: number): void {
    const f = this.frame(), d = this.distance;
    this.eye = add(add(add(this.eye, f.right, d * right), f.down, d * down), f.forward, d * forward);
  }

  // Towards the point in front.
  dolly(factor: number): void {
    const pivot = add(this.eye, this.forward, this.distance);
    this.distance = Math.min(Math.max(this.distance * factor, 0.01 * this.radius), 100 * this.radius);
    this.eye = add(pivot, this.forward, -this.distance);
  }

  // Where a point is in a picture of this size, px; null: behind.
  project(point: V3, width: number, height: number): [number, number] | null {
    const f = this.frame(), to = add(point, f.eye, -1);
    const z = dot(to, f.forward);
    if (z < 1e-3 * this.radius) return null;
    const focal = this.focal(height);
    return [width / 2 + focal * dot(to, f.right) / z, height / 2 + focal * dot(to, f.down) / z];
  }

  // The direction, of unit length, of what a picture of this size shows at x, y.
  ray(x: number, y: number, width: number, height: number): V3 {
    const f = this.frame(), focal = this.focal(height);
    return unit(add(add(f.forward, f.right, (x - width / 2) / focal), f.down, (y - height / 2) / focal));
  }

  // Level and of unit length; any that is, where `forward` is up or down.
  private rightOf(forward: V3): V3 {
    const right = cross(forward, this.up);
    if (length(right) > 1e-6) return unit(right);
    const other: V3 = Math.abs(this.up[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0];
    return unit(cross(forward, other));
  }

  private focal(height: number): number { return height / 2 / Math.tan(this.fovDeg * Math.PI / 360); }
}
