// SHA-256 (FIPS 180-4) of what comes in pieces: browsers digest whole buffers only, and only on
// pages with TLS.

// The first 32 bits of the fractional parts of the cube roots of the first 64 primes, and of the
// square roots of the first 8.
const primes: number[] = [];
for (let n = 2; primes.length < 64; ++n) if (primes.every((p) => n % p !== 0)) primes.push(n);
const fraction = (x: number): number => ((x - Math.floor(x)) * 2 ** 32) | 0;
const kRounds = Int32Array.from(primes, (p) => fraction(Math.cbrt(p)));
const kStart = Int32Array.from(primes.slice(0, 8), (p) => fraction(Math.sqrt(p)));

export class Sha256 {
  private readonly state = kStart.slice();
  private readonly words = new Int32Array(64);
  private readonly rest = new Uint8Array(64);
  private length = 0;

  update(bytes: Uint8Array): void {
    let at = 0;
    const open = this.length % 64;
    this.length += bytes.length;
    if (open > 0) {
      at = Math.min(64 - open, bytes.length);
      this.rest.set(bytes.subarray(0, at), open);
      if (open + at < 64) return;
      this.block(this.rest, 0);
    }
    for (; at + 64 <= bytes.length; at += 64) this.block(bytes, at);
    this.rest.set(bytes.subarray(at));
  }

  digest(): Uint8Array {
    const bits = this.length * 8;
    const tail = new Uint8Array(this.length % 64 < 56 ? 64 - this.length % 64
                                                      : 128 - this.length % 64);
    tail[0] = 0x80;
    const view = new DataView(tail.buffer);
    view.setUint32(tail.length - 8, Math.floor(bits / 2 ** 32));
    view.setUint32(tail.length - 4, bits >>> 0);
    this.update(tail);
    const out = new Uint8Array(32);
    const result = new DataView(out.buffer);
    this.state.forEach((word, i) => result.setInt32(4 * i, word));
    return out;
  }

  private block(bytes: Uint8Array, at: number): void {
    const w = this.words;
    for (let i = 0; i < 16; ++i, at += 4) {
      w[i] = bytes[at]! << 24 | bytes[at + 1]! << 16 | bytes[at + 2]! << 8 | bytes[at + 3]!;
    }
    for (let i = 16; i < 64; ++i) {
      const a = w[i - 15]!, b = w[i - 2]!;
      const s0 = (a >>> 7 | a << 25) ^ (a >>> 18 | a << 14) ^ (a >>> 3);
      const s1 = (b >>> 17 | b << 15) ^ (b >>> 19 | b << 13) ^ (b >>> 10);
      w[i] = (w[i - 16]! + s0 + w[i - 7]! + s1) | 0;
    }
    let [a, b, c, d, e, f, g, h] = this.state as unknown as
        [number, number, number, number, number, number, number, number];
    for (let i = 0; i < 64; ++i) {
      const s1 = (e >>> 6 | e << 26) ^ (e >>> 11 | e << 21) ^ (e >>> 25 | e << 7);
      const t1 = (h + s1 + ((e & f) ^ (~e & g)) + kRounds[i]! + w[i]!) | 0;
      const s0 = (a >>> 2 | a << 30) ^ (a >>> 13 | a << 19) ^ (a >>> 22 | a << 10);
      const t2 = (s0 + ((a & b) ^ (a & c) ^ (b & c))) | 0;
      h = g; g = f; f = e; e = (d + t1) | 0;
      d = c; c = b; b = a; a = (t1 + t2) | 0;
    }
    [a, b, c, d, e, f, g, h].forEach((value, i) => { this.state[i] = (this.state[i]! + value) | 0; });
  }
}

// Of a file, as Base64.
export async function digestOf(file: Blob): Promise<string> {
  const kPiece = 4 << 20;
  const sha = new Sha256();
  for (let at = 0; at < file.size; at += kPiece) {
    sha.update(new Uint8Array(await file.slice(at, at + kPiece).arrayBuffer()));
  }
  return btoa(String.fromCharCode(...sha.digest()));
}
