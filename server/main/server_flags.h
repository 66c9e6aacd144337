#ifndef LITAGS_SERVER_MAIN_SERVER_FLAGS_H_
#define LITAGS_SERVER_MAIN_SERVER_FLAGS_H_

#include <string>

#include "server/api/server.h"
#include "server/config/settings.h"
#include "server/store/open_stores.h"
#include "server/web/web_server.h"

namespace litags {

// Everything that an operator can set.
struct ServerFlags {
  ServerOptions server;
  UploadLimits uploads;
  std::string data;
  StorePlaces places;
  std::string colmap = "colmap";
  std::string depth_model;
  std::string log_level = "info";
  std::string log_format = "text";
  std::string port_file;
  web::WebOptions web;        // no listen: no page; most of it follows from `server`
  std::string web_port_file;  // as port_file
  WebhookPolicy webhooks;
  std::string webhook_ca;         // certificates that receivers are checked by; empty: the system's
  std::string metrics_listen;     // empty: no metrics
  bool metrics_for_all = false;   // others than this machine may read them
  double self_call_seconds = 10;  // between calls to itself; 0: none
  int workers = 1;
  int threads = 0;       // per job; 0: all cores
  int worker_cores = 0;  // that jobs may count on; 0: a share of those found
  std::vector<std::string> worker_labels;
  int worker_niceness = 5;            // pictures, which somebody waits for, go before jobs
  int64_t worker_memory_bytes = 0;    // address space of each worker; 0: no limit
  double colmap_step_seconds = 3600;  // 0: no limit
  bool worker_network = false;        // whether workers stay in the machine's network
  double keep_seconds = StorePlaces::kKeepSeconds;  // between checkpoints sent to S3
  double sweep_seconds = 60;                        // between looks for what can be removed

  // Belong to one run.
  std::string config;
  bool print_config = false;
  bool check = false;
};

// Adds an option for each, with checks and help.
void AddServerFlags(CLI::App* app, ServerFlags* flags);

// INVALID_ARGUMENT (SETTING_UNUSED) for a setting that does nothing without another one, which is
// not there. Limits of what is off may stay.
absl::Status CheckSettingsAreUsed(const ServerFlags& flags);

// How they are looked for beside the command line: LITAGS_SERVER_..., and which are secret.
Settings::Rules ServerSettingsRules();

}  // namespace litags

#endif  // LITAGS_SERVER_MAIN_SERVER_FLAGS_H_
