// A folder of badly lit photos becomes a picture in normal light, and a scene for viewers:
//   node out/reconstruct.js night_photos/ view.png scene.ply     (docs/languages.md)
import { createHash, randomUUID } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
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

// The service's reason and field of an error, for programs.
function detailOf(error: unknown) {
  return ConnectError.from(error).findDetails(ErrorDetailSchema)[0];
}

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
    interceptors: [withToken],
    // Without `ca` the authorities of Node.js are trusted.
    nodeOptions: tls ? { ca: read(ca), cert: read(cert), key: read(key), servername: name } : {},
  });
}

async function* upload(job: string, photo: string) {
  yield { part: { case: "name" as const, value: job } };
  const data = readFileSync(`${folder}/${photo}`);
  const sha256 = createHash("sha256").update(data).digest();
  const file = { name: photo, sizeBytes: BigInt(data.length), sha256 };
  yield { part: { case: "file" as const, value: file } };
  for (let at = 0; at < data.length; at += 256 << 10) {
    yield { part: { case: "chunk" as const, value: data.subarray(at, at + (256 << 10)) } };
  }
  yield { part: { case: "end" as const, value: { files: 1 } } };
}

// Uploads the photos and starts the job. Each photo has a stream of its own, so that those that the
// service cannot read are left out.
async function submit(jobs: Jobs, name: string, photos: string[]) {
  for (const photo of photos) {
    try {
      await jobs.uploadImages(upload(name, photo));
    } catch (error) {
      if (!/^(IMAGE_.*|FILE_EMPTY)$/.test(detailOf(error)?.reason ?? "")) throw error;
      console.error(`${photo} is left out: ${ConnectError.from(error).rawMessage}`);
    }
  }
  await jobs.startJob({ name, requestId: randomUUID() });
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
      return jobs.getJob({ name });
    } catch (error) {
      // Canceled: what Node.js makes of a connection that was cut.
      const broken = [Code.Unavailable, Code.Aborted, Code.Canceled];
      if (!broken.includes(ConnectError.from(error).code) || ++failures > 60) throw error;
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }
}

async function main() {
  // Hidden ones, as a Mac's ._0001.jpg, are no photos.
  const photos = readdirSync(folder).filter((name) => /^[^.].*\.(jpe?g|png)$/i.test(name)).sort();
  const transport = connect();
  const jobs = createClient(ReconstructionService, transport);
  const options = iterations ? { iterations: Number(iterations) } : {}; // else the server's default
  const { name } = await jobs.createJob({ requestId: randomUUID(), options });
  try {
    await submit(jobs, name, photos);
  } catch (error) { // nobody goes on with the job
    await jobs.deleteJob({ name, allowMissing: true }).catch(() => {
      console.error(`${name} is left there, not started; remove it with: litags delete ${name}`);
    });
    throw error;
  }
  const job = await watch(jobs, name);
  if (job.state !== JobState.SUCCEEDED) throw new Error(job.error?.message ?? "cancelled");
  const pictures = createClient(RenderService, transport);
  const [placed] = (await pictures.listCameras({ name })).cameras; // photos may have been left out
  const pose = { pose: { case: "camera" as const, value: placed.name } };
  const view = await pictures.renderView({ name, pose });
  writeFileSync(picture, view.data);
  const chunks: Uint8Array[] = [];
  for await (const { part } of createClient(ModelService, transport).exportModel({ name })) {
    if (part.case === "chunk") chunks.push(part.value);
  }
  writeFileSync(scene, Buffer.concat(chunks));
}

main().catch((error) => {
  const detail = detailOf(error);
  console.error(error.message, detail?.reason ?? "", detail?.field ?? "");
  process.exit(1);
});
