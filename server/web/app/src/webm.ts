// Pictures that follow each other as a WebM file: a track of VP9, and where its clusters are.
// Elements: https://www.rfc-editor.org/rfc/rfc9559

export interface Packet {
  ms: number;    // when it is shown
  key: boolean;  // it needs none before it
  bytes: Uint8Array<ArrayBuffer>;
}

type Part = Uint8Array<ArrayBuffer>;

const kMuxer = "litags";

// Most significant byte first; without `length`, as short as can be.
function integer(value: number, length = 0): Part {
  const bytes: number[] = [];
  for (let rest = value; rest > 0 || bytes.length < Math.max(1, length); rest = Math.floor(rest / 256)) {
    bytes.unshift(rest % 256);
  }
  return new Uint8Array(bytes);
}

function float(value: number): Part {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setFloat64(0, value);
  return bytes;
}

const text = (value: string): Part => new Uint8Array([...value].map((c) => c.charCodeAt(0)));
const lengthOf = (parts: Part[]): number => parts.reduce((sum, part) => sum + part.length, 0);

// An element's head with its length in eight bytes, then what is in it.
function element(id: number, ...parts: Part[]): Part[] {
  const length = integer(lengthOf(parts), 8);
  length[0] = 1;
  return [integer(id), length, ...parts];
}

function tracks(width: number, height: number): Part[] {
  const video = element(0xe0, ...element(0xb0, integer(width)), ...element(0xba, integer(height)));
  return element(0x1654ae6b, ...element(
      0xae, ...element(0xd7, integer(1)), ...element(0x73c5, integer(1)), ...element(0x83, integer(1)),
      ...element(0x9c, integer(0)), ...element(0x86, text("V_VP9")), ...video));
}

// From one key picture to the next, which must be less than 32 s later.
function cluster(packets: Packet[]): Part[] {
  const start = Math.round(packets[0]!.ms);
  return element(0x1f43b675, ...element(0xe7, integer(start)), ...packets.flatMap(
      ({ms, key, bytes}) => element(0xa3, new Uint8Array([0x81]), integer(Math.round(ms) - start, 2),
                                    new Uint8Array([key ? 0x80 : 0]), bytes)));
}

function cues(times: number[], places: number[]): Part[] {
  return element(0x1c53bb6b, ...times.flatMap((time, i) => element(
      0xbb, ...element(0xb3, integer(time)),
      ...element(0xb7, ...element(0xf7, integer(1)), ...element(0xf1, integer(places[i] ?? 0, 8))))));
}

// The first packet must be a key picture.
export function webm(packets: Packet[], width: number, height: number, durationMs: number): Blob {
  const groups: Packet[][] = [];
  for (const packet of packets) {
    if (packet.key) groups.push([packet]);
    else groups[groups.length - 1]!.push(packet);
  }
  const head = [
    ...element(0x1549a966, ...element(0x2ad7b1, integer(1e6)), ...element(0x4489, float(durationMs)),
               ...element(0x4d80, text(kMuxer)), ...element(0x5741, text(kMuxer))),
    ...tracks(width, height)];
  const clusters = groups.map(cluster);
  const times = groups.map((group) => Math.round(group[0]!.ms));
  let place = lengthOf(head) + lengthOf(cues(times, []));
  const places = clusters.map((parts) => {
    const here = place;
    place += lengthOf(parts);
    return here;
  });
  const file = [
    ...element(0x1a45dfa3, ...element(0x4286, integer(1)), ...element(0x42f7, integer(1)),
               ...element(0x42f2, integer(4)), ...element(0x42f3, integer(8)),
               ...element(0x4282, text("webm")), ...element(0x4287, integer(4)), ...element(0x4285, integer(2))),
    ...element(0x18538067, ...head, ...cues(times, places), ...clusters.flat())];
  return new Blob(file, {type: "video/webm"});
}
