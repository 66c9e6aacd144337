#include "server/main/server_flags.h"

#include <pwd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

// Services may have no HOME. Empty for a user without a folder: --data is needed.
std::string DefaultDataFolder() {
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0') {
    const passwd* user = getpwuid(getuid());
    home = user == nullptr ? nullptr : user->pw_dir;
  }
  return home == nullptr || *home != '/' ? "" : absl::StrCat(home, "/.local/share/litags");
}

void AddAccessFlags(CLI::App* app, ServerOptions* server) {
  app->add_option("--listen", server->listen, "HOST:PORT to listen on; port 0: any free one")
      ->check(
          [](const std::string& text) { return text.empty() ? "takes HOST:PORT, not \"\"" : ""; })
      ->capture_default_str();
  app->add_flag("--insecure", server->insecure,
                "Let other machines connect without TLS, or without authentication");
  app->add_option("--tls-cert", server->tls.cert,
                  "Certificate of the server, and its issuers (PEM)");
  app->add_option("--tls-key", server->tls.key, "Private key of the certificate (PEM)");
  app->add_option("--tls-client-ca", server->tls.client_ca,
                  "Clients must show a certificate issued by one of these (PEM); its common name "
                  "names the client");
  app->add_option("--tokens", server->auth.tokens_path,
                  "File of token digests, made by \"token NAME\"; read again when it changes");
  app->add_option("--token", server->auth.token_entries, "Token digest, NAME:sha256:HEX; several")
      ->delimiter(',');
  app->add_option("--admins", server->auth.admins,
                  "Names of clients that see and change everybody's jobs")
      ->delimiter(',');
}

void AddClientLimitFlags(CLI::App* app, ClientLimits* limits) {
  const auto add = [app](const char* name, auto& value, const char* help) {
    app->add_option(name, value, help)->check(AtLeastZero(value))->capture_default_str();
  };
  add("--max-jobs", limits->max_jobs, "Jobs of one client at one time; 0: no limit");
  add("--max-bytes", limits->max_bytes,
      "Bytes of all files and results of one client; 0: no limit");
  add("--max-streams", limits->max_streams,
      "Uploads, watches, paths and exports of one client at one time; 0: no limit");
  add("--pictures-per-second", limits->pictures_per_second,
      "Calls for pictures of one client a second; 0: no limit");
  // With fewer than one, no call would ever be let in.
  app->add_option("--picture-burst", limits->picture_burst, "So many calls at once after a pause")
      ->check(Between(1.0, 1e9))
      ->capture_default_str();
}

void AddCapFlags(CLI::App* app, JobCaps* caps) {
  const auto add = [app](const char* name, auto& value, const char* help) {
    app->add_option(name, value, help)->check(AtLeastZero(value))->capture_default_str();
  };
  add("--max-iterations", caps->max_iterations, "Iterations that a job may ask for; 0: no limit");
  add("--max-gaussians", caps->max_gaussians, "Gaussians that a job may ask for; 0: no limit");
  add("--max-run-seconds", caps->max_run_seconds,
      "Seconds that a job may ask to run, and gets that asks for none; 0: no limit");
  app->add_option("--max-priority", caps->max_priority,
                  "Priority that clients with a name may ask for")
      ->check(Between(-kMaxJobPriority, kMaxJobPriority))
      ->capture_default_str();
  app->add_option("--max-job-memory", caps->max_memory_bytes,
                  "Memory that a job may ask for, as 6GiB; 0: no limit")
      ->transform(ByteSize())
      ->capture_default_str();
}

void AddUploadCpuFlags(CLI::App* app, UploadCpuLimits* limits) {
  const auto add = [app](const char* name, auto& value, const char* help) {
    app->add_option(name, value, help)->check(AtLeastZero(value))->capture_default_str();
  };
  add("--upload-cpu", limits->per_second,
      "Seconds of one core, each second, that the uploads of one client may take; beyond, they "
      "wait; 0: no limit");
  add("--upload-cpu-burst", limits->burst_seconds, "So many such seconds at once after a pause");
}

void AddRenderFlags(CLI::App* app, ServerOptions* server) {
  const auto add = [app](const char* name, auto& value, const char* help) {
    app->add_option(name, value, help)->check(AboveZero(value))->capture_default_str();
  };
  add("--render-workers", server->render_threads, "Pictures made at the same time");
  add("--render-threads", server->render.threads, "Threads per picture");
  add("--max-waiting-pictures", server->max_waiting_pictures,
      "Pictures of one client that may wait for their turn");
  add("--max-pixels", server->render.max_pixels, "Pixels of a picture");
  add("--max-unread", server->answers.max_unread_seconds,
      "Seconds after which a client that does not read its answer is cut off; large answers get a "
      "second more for each MiB");
  app->add_option("--max-unread-bytes", server->answers.max_unread_bytes,
                  "Memory for pictures and models that clients have not read yet, as 512MiB; one "
                  "client may have half of it")
      ->transform(ByteSize())
      ->check(AboveZero(server->answers.max_unread_bytes))
      ->capture_default_str();
  app->add_option("--max-export-bytes", server->answers.max_export_bytes,
                  "Disk space for exported models that clients have not read yet, as 4GiB; one "
                  "client may have half of it")
      ->transform(ByteSize())
      ->check(AboveZero(server->answers.max_export_bytes))
      ->capture_default_str();
  app->add_option("--scene-cache", server->scene_cache_bytes,
                  "Memory for scenes that were rendered last, as 1GiB; at least one stays")
      ->transform(ByteSize())
      ->capture_default_str();
}

void AddConnectionFlags(CLI::App* app, ConnectionLimits* limits) {
  const auto add = [app](const char* name, auto& value, const char* help) {
    app->add_option(name, value, help)->check(AboveZero(value))->capture_default_str();
  };
  add("--max-connections", limits->counts.max_connections,
      "Connections at the same time, as far as the limit of open files allows; one network may "
      "have half of them, one client a quarter");
  add("--max-newcomers", limits->counts.max_newcomers,
      "Connections at the same time of which no call was let in yet; beyond, the oldest of where "
      "most come from goes");
  add("--max-first-call", limits->counts.newcomer_seconds,
      "Seconds within which a call of a new connection must be let in");
  add("--max-connection-calls", limits->max_calls, "Calls at the same time on one connection");
  add("--keepalive", limits->keepalive_seconds,
      "Seconds after which a silent client is asked whether it is there");
  add("--keepalive-timeout", limits->keepalive_timeout_seconds,
      "Seconds that it may take to answer");
  add("--min-ping", limits->min_ping_seconds, "A client that asks more often, seconds, is cut off");
  add("--max-idle", limits->max_idle_seconds,
      "Seconds before a connection without calls is closed");
  add("--max-wait", limits->max_wait_seconds,
      "Seconds that a call with one answer may wait for its turn");
}

void AddWebFlags(CLI::App* app, ServerFlags* flags) {
  app->add_option("--web", flags->web.listen,
                  "HOST:PORT for the page in the browser and the services by HTTP; none: no page");
  app->add_option("--web-port-file", flags->web_port_file,
                  "Write the page's port to this file once it is open");
  app->add_option("--max-web-connections", flags->web.counts.max_connections,
                  "Connections to the page at the same time; one network may have half of them")
      ->check(AboveZero(flags->web.counts.max_connections))
      ->capture_default_str();
}

void AddJobFlags(CLI::App* app, ServerFlags* flags) {
  app->add_option("--data", flags->data, "Folder for jobs and scenes")->capture_default_str();
  app->add_option(
      "--store", flags->places.jobs,
      "Jobs: sqlite:///FILE or postgresql://... (default: litags.db in the data folder)");
  app->add_option("--blobs", flags->places.blobs,
                  "Photos, checkpoints, scenes: file:///FOLDER or s3://BUCKET/PREFIX (default: "
                  "blobs/ in the data folder)");
  app->add_option("--s3-endpoint", flags->places.s3_endpoint, "S3 server, if it is not Amazon's");
  app->add_option("--keep-every", flags->keep_seconds,
                  "Seconds between two times that a job's checkpoint and snapshot are sent to S3")
      ->check(AtLeastZero(flags->keep_seconds))
      ->capture_default_str();
  app->add_option("--workers", flags->workers, "Jobs that run at the same time on this machine")
      ->check(Between(0, 256))
      ->capture_default_str();
  app->add_option("--worker-niceness", flags->worker_niceness,
                  "Jobs leave the processor to pictures by so much")
      ->check(Between(0, 19))
      ->capture_default_str();
  app->add_option("--worker-cores", flags->worker_cores,
                  "Cores that the jobs of each worker here may count on; 0: its share of the "
                  "machine's, or --threads")
      ->check(AtLeastZero(flags->worker_cores))
      ->capture_default_str();
  app->add_option("--worker-labels", flags->worker_labels,
                  "What else jobs may ask for, as avx512,site-b")
      ->delimiter(',');
  app->add_option("--threads", flags->threads, "Threads per job; 0: all cores")
      ->check(AtLeastZero(flags->threads))
      ->capture_default_str();
  app->add_option("--colmap", flags->colmap, "COLMAP program: a name or a path")
      ->capture_default_str();
  app->add_option("--depth-model", flags->depth_model,
                  "ONNX depth network for jobs with depth_source NETWORK: FILE[,size=518x518]"
                  "[,mean=R:G:B][,std=R:G:B][,output=inverse|depth]");
  app->add_option("--colmap-timeout", flags->colmap_step_seconds,
                  "Seconds that one COLMAP step may take; 0: no limit")
      ->check(AtLeastZero(flags->colmap_step_seconds))
      ->capture_default_str();
  app->add_option("--worker-memory", flags->worker_memory_bytes,
                  "Address space of a worker and of each program it starts, as 6GiB; 0: no limit")
      ->transform(ByteSize())
      ->capture_default_str();
  app->add_flag("--worker-network", flags->worker_network,
                "Leave workers in the machine's network, which they do not need");
}

void AddWebhookFlags(CLI::App* app, ServerFlags* flags) {
  app->add_option(
         "--webhook-hosts", flags->webhooks.hosts,
         "Hosts that jobs may tell of their end, as hooks.example.com,*.example.org; \"*\": "
         "all; none: no job may")
      ->delimiter(',');
  app->add_flag("--webhook-internal", flags->webhooks.internal,
                "Also hosts whose addresses are not of the internet, and http");
  app->add_option("--webhook-ca", flags->webhook_ca,
                  "Certificates that those hosts are checked by (PEM); default: the system's");
}

void AddUploadFlags(CLI::App* app, ServerFlags* flags) {
  const auto add = [app](const char* name, auto& value, const char* help) {
    app->add_option(name, value, help)->check(AboveZero(value))->capture_default_str();
  };
  add("--keep-uploads", flags->uploads.keep_seconds,
      "Seconds after which a job that was not started, and gets no files, is removed");
  add("--max-upload-silence", flags->uploads.max_silence_seconds,
      "Seconds after which an upload that sends nothing is ended; what came is kept");
  add("--max-job-bytes", flags->uploads.max_job_bytes, "Bytes of all files of a job");
  add("--sweep-every", flags->sweep_seconds,
      "Seconds between looks for jobs and files that can be removed");
}

}  // namespace

void AddServerFlags(CLI::App* app, ServerFlags* flags) {
  flags->data = DefaultDataFolder();
  AddJobFlags(app, flags);
  AddUploadFlags(app, flags);
  AddWebhookFlags(app, flags);
  AddAccessFlags(app, &flags->server);
  AddClientLimitFlags(app, &flags->server.limits);
  AddCapFlags(app, &flags->server.limits.caps);
  AddUploadCpuFlags(app, &flags->server.upload_cpu);
  AddRenderFlags(app, &flags->server);
  AddConnectionFlags(app, &flags->server.connections);
  AddWebFlags(app, flags);
  app->add_option("--metrics-listen", flags->metrics_listen,
                  "HOST:PORT for Prometheus, plain HTTP; other addresses than this machine's need "
                  "--metrics-for-all; none: no metrics");
  app->add_flag("--metrics-for-all", flags->metrics_for_all,
                "Whoever reaches --metrics-listen may read the metrics; calls stay as they are");
  app->add_option("--self-call", flags->self_call_seconds,
                  "Seconds between calls of the server to itself: one that answers none of twelve "
                  "ends with an error; 0: no calls")
      ->check(AtLeastZero(flags->self_call_seconds))
      ->capture_default_str();
  app->add_option("--log-level", flags->log_level, "debug, info, warn or error")
      ->capture_default_str();
  app->add_option("--log-format", flags->log_format, "text, or json: one object a line")
      ->check(OneOf({"text", "json"}))
      ->capture_default_str();
  app->add_option("--port-file", flags->port_file, "Write the port to this file once it is open");
  app->add_option("--config", flags->config, "TOML file of settings; flags and variables beat it");
  CLI::Option* print_config =
      app->add_flag("--print-config", flags->print_config,
                    "Print all settings, and where each comes from, and end");
  app->add_flag("--check", flags->check, "Check that all is in place to start, and end")
      ->excludes(print_config);
}

absl::Status CheckSettingsAreUsed(const ServerFlags& flags) {
  const bool webhooks = !flags.webhooks.hosts.empty();
  const bool names = flags.server.auth.enabled() || !flags.server.tls.client_ca.empty();
  const struct {
    const char* setting;
    bool given;
    const char* other;
    bool there;
  } kRules[] = {
      {"--web-port-file", !flags.web_port_file.empty(), "--web", !flags.web.listen.empty()},
      {"--metrics-for-all", flags.metrics_for_all, "--metrics-listen",
       !flags.metrics_listen.empty()},
      {"--webhook-internal", flags.webhooks.internal, "--webhook-hosts", webhooks},
      {"--webhook-ca", !flags.webhook_ca.empty(), "--webhook-hosts", webhooks},
      {"--admins", !flags.server.auth.admins.empty(), "--tokens, --token or --tls-client-ca",
       names},
  };
  for (const auto& rule : kRules) {
    if (!rule.given || rule.there) continue;
    return InvalidInput("SETTING_UNUSED", rule.setting,
                        absl::StrCat(rule.setting, " does nothing without ", rule.other,
                                     "; give that, too, or leave this out"));
  }
  return absl::OkStatus();
}

Settings::Rules ServerSettingsRules() {
  return {"LITAGS_SERVER",
          {{"data", "LITAGS_DATA"},
           {"store", "LITAGS_STORE"},
           {"blobs", "LITAGS_BLOBS"},
           {"s3-endpoint", "LITAGS_S3_ENDPOINT"}},
          {"config", "print-config", "check", "version"},
          {"token", "store"}};
}

}  // namespace litags
