// A folder of badly lit photos becomes a picture in normal light, and a scene for viewers:
//   node out/reconstruct.js night_photos/ view.png scene.ply     (docs/languages.md)
import { createHash, randomUUID } from "node:crypto";
import { readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { dirname } from "node:path";
import { type Client, Code, ConnectError, type Interceptor, createClient } from "@connectrpc/connect";
import { createGrpcTransport } from "@connectrpc/connect-node";
import { ErrorDetailSchema } from "./gen/litags/v1/errors_pb.js";
import { JobState } from "./gen/litags/v1/job_pb.js";
import { ModelService } from "./gen/litags/v1/model_service_pb.js";
import { ReconstructionService } from "./gen/litags/v1/reconstruction_service_pb.js";
import { RenderService } from "./gen/litags/v1/render_service_pb.js";

type Jobs = Client<typeof ReconstructionService>;

const [folder, picture, scene, iterations] = process.argv.slice(2);
if (!scene) {
  console.error("give PHOTOS VIEW.png SCENE.ply [ITERATIONS]");
  process.exit(1);
}
if (!scene.toLowerCase().endsWith(".ply")) {
  console.error(`${scene}: this program writes PLY only; name it .ply`);
  process.exit(1);
}

// The service's reason and field of an error, for programs.
function detailOf(error: unknown) {
  return ConnectError.from(error).findDetails(ErrorDetailSchema)[0];
}

// Whether the same call may succeed later: the connection broke, or the server is busy. Canceled: what
// Node.js makes of a connection that was cut.
function mayRetry(error: unknown): boolean {
  const { code, details } = ConnectError.from(error);
  return [Code.Unavailable, Code.Aborted, Code.Canceled].includes(code)
      || details.some((detail) => "type" in detail && detail.type === "google.rpc.RetryInfo");
}

let answered = false; // a server that never did so is tried for a few seconds only

// Repeats a call that is safe to repeat.
async function persistently<T>(call: () => Promise<T>): Promise<T> {
  for (let attempt = 1; ; ++attempt) {
    try {
      const answer = await call();
      answered = true;
      return answer;
    } catch (error) {
      if (!mayRetry(error) || attempt === (answered ? 60 : 5)) throw error;
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }
}

// Repeats all calls but streams. Those that make or start a job have a requestId: once more changes
// nothing.
const again: Interceptor = (next) => (request) =>
  request.stream ? next(request) : persistently(() => next(request));

// Takes the environment variables of the program litags.
function connect() {
  const { env } = process;
  const server = env.LITAGS_SERVER || "127.0.0.1:50051";
  const read = (path?: string) => (path ? readFileSync(path) : undefined);
  const token = read(env.LITAGS_TOKEN_FILE)?.toString().trim() ?? env.LITAGS_TOKEN;
  const { LITAGS_TLS_CA: ca, LITAGS_TLS_CERT: cert, LITAGS_TLS_KEY: key, LITAGS_TLS_NAME: name } = env;
  if (!cert !== !key) throw new Error("LITAGS_TLS_CERT and LITAGS_TLS_KEY belong together; set both");
  const tls = ca || cert || name || !/^(0|false|no|off)?$/i.test(env.LITAGS_TLS ?? "");
  if (token && !tls && !/^(localhost|127\.[\d.]+|\[::1\]):\d+$/.test(server)) {
    throw new Error(`the token would travel to ${server} unencrypted; set LITAGS_TLS=1 or LITAGS_TLS_CA`);
  }
  const withToken: Interceptor = (next) => (request) => {
    if (token) request.header.set("authorization", `Bearer ${token}`);
    return next(request);
  };
  return createGrpcTransport({
    baseUrl: `${tls ? "https" : "http"}://${server}`,
    interceptors: [again, withToken],
    pingIntervalMs: 1000 * Number(env.LITAGS_KEEPALIVE || 30), // a silent server is asked whether it is there
    pingTimeoutMs: 10_000,
    // Without `ca` the authorities of Node.js are trusted.
    nodeOptions: tls ? { ca: read(ca), cert: read(cert), key: read(key), servername: name } : {},
  });
}

async function* upload(job: string, photo: string) {
  yield { part: { case: "name" as const, value: job } };
  const data = readFileSync(`${folder}/${photo}`);
  const sha256 = createHash("sha256").update(data).digest();
  const file = { fileName: photo, sizeBytes: BigInt(data.length), sha256 };
  yield { part: { case: "file" as const, value: file } };
  for (let at = 0; at < data.length; at += 256 << 10) {
    yield { part: { case: "chunk" as const, value: data.subarray(at, at + (256 << 10)) } };
  }
  yield { part: { case: "end" as const, value: { files: 1 } } };
}

// Each photo has a stream of its own, so that those that the service cannot read are left out.
async function uploadAll(jobs: Jobs, name: string, photos: string[]) {
  for (const photo of photos) {
    try {
      await persistently(() => jobs.uploadImages(upload(name, photo)));
    } catch (error) {
      if (!/^(IMAGE_.*|FILE_EMPTY)$/.test(detailOf(error)?.reason ?? "")) throw error;
      console.error(`${photo} is left out: ${ConnectError.from(error).rawMessage}`);
    }
  }
}

// Uploads the photos and starts the job. A job that does not run is deleted: nobody goes on with it.
async function submit(jobs: Jobs, name: string, photos: string[]) {
  let sent = false;
  try {
    await uploadAll(jobs, name, photos);
    sent = true;
    await jobs.startJob({ name, requestId: randomUUID() });
  } catch (error) {
    // Else the service refused it: errors of servers that are away or busy have a reason, too.
    if (sent && (!detailOf(error) || mayRetry(error))) {
      console.error(`${name} may have been started; see: litags watch ${name}`);
      throw error;
    }
    await jobs.deleteJob({ name, allowMissing: true }).catch(() => {
      console.error(`${name} is left there, not started; remove it with: litags delete ${name}`);
    });
    throw error;
  }
}

// Follows the job to its end; a broken connection goes on after the last event that came.
async function watch(jobs: Jobs, name: string) {
  for (let afterEvent = 0n, failures = 0; ; ) {
    try {
      for await (const event of jobs.watchJob({ name, afterEvent })) {
        [afterEvent, failures] = [event.number, 0];
        if (event.event.case === "stateChange") {
          console.log(JobState[event.event.value.state], event.event.value.message);
        }
      }
      return await jobs.getJob({ name });
    } catch (error) {
      if (!mayRetry(error) || ++failures > 60) throw error;
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }
}

async function main() {
  // Hidden ones, as a Mac's ._0001.jpg, are no photos.
  const photos = readdirSync(folder).filter((name) => /^[^.].*\.(jpe?g|png)$/i.test(name)).sort();
  for (const file of [picture, scene]) statSync(dirname(file)); // now, not after hours
  const transport = connect();
  const jobs = createClient(ReconstructionService, transport);
  const options = iterations ? { iterations: Number(iterations) } : {}; // else the server's default
  const { name } = await jobs.createJob({ requestId: randomUUID(), options });
  await submit(jobs, name, photos);
  console.log(name); // goes on whatever becomes of this program: litags watch
  const job = await watch(jobs, name);
  if (job.state !== JobState.SUCCEEDED) throw new Error(job.error?.message ?? "cancelled");
  const pictures = createClient(RenderService, transport);
  const [placed] = (await pictures.listCameras({ name })).cameras; // photos may have been left out
  const pose = { pose: { case: "camera" as const, value: placed.name } };
  const view = await pictures.renderView({ name, pose });
  writeFileSync(picture, view.data);
  const models = createClient(ModelService, transport);
  writeFileSync(scene, await persistently(async () => {
    const chunks: Uint8Array[] = [];
    for await (const { part } of models.exportModel({ name })) {
      if (part.case === "chunk") chunks.push(part.value);
    }
    return Buffer.concat(chunks);
  }));
}

main().catch((error) => {
  const detail = detailOf(error);
  console.error(error.message, detail?.reason ?? "", detail?.field ?? "");
  process.exit(1);
});
