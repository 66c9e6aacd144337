// A folder of badly lit photos becomes a picture in normal light, and a scene for viewers:
//   node out/reconstruct.js night_photos/ view.png scene.ply     (docs/languages.md)
import { createHash, randomUUID } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { Code, ConnectError, createClient } from "@connectrpc/connect";
import { createGrpcTransport } from "@connectrpc/connect-node";
import { ErrorDetailSchema } from "./gen/litags/v1/errors_pb.js";
import { JobState } from "./gen/litags/v1/job_pb.js";
import { ModelService } from "./gen/litags/v1/model_service_pb.js";
import { ReconstructionService } from "./gen/litags/v1/reconstruction_service_pb.js";
import { RenderService } from "./gen/litags/v1/render_service_pb.js";

const [folder, picture, scene, iterations] = process.argv.slice(2);
if (!scene) {
  console.error("give PHOTOS VIEW.png SCENE.ply [ITERATIONS]");
  process.exit(1);
}
const server = process.env.LITAGS_SERVER ?? "127.0.0.1:50051";
const transport = createGrpcTransport({ baseUrl: `http://${server}` });
const jobs = createClient(ReconstructionService, transport);
const photos = readdirSync(folder).filter((name) => /\.(jpe?g|png)$/i.test(name)).sort();

async function* upload(job: string) {
  yield { part: { case: "name" as const, value: job } };
  for (const name of photos) {
    const data = readFileSync(`${folder}/${name}`);
    const sha256 = createHash("sha256").update(data).digest();
    const file = { name, sizeBytes: BigInt(data.length), sha256 };
    yield { part: { case: "file" as const, value: file } };
    for (let at = 0; at < data.length; at += 256 << 10) {
      yield { part: { case: "chunk" as const, value: data.subarray(at, at + (256 << 10)) } };
    }
  }
  yield { part: { case: "end" as const, value: { files: photos.length } } };
}

// Follows the job to its end; a broken connection goes on after the last event that came.
async function watch(name: string) {
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
  const options = iterations ? { iterations: Number(iterations) } : {}; // else the server's default
  const { name } = await jobs.createJob({ requestId: randomUUID(), options });
  await jobs.uploadImages(upload(name));
  await jobs.startJob({ name, requestId: randomUUID() });
  const job = await watch(name);
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
  const [detail] = ConnectError.from(error).findDetails(ErrorDetailSchema);
  console.error(error.message, detail?.reason ?? "", detail?.field ?? "");
  process.exit(1);
});
