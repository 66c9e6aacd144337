// Prints the jobs of a server: list_jobs HOST:PORT
#include <iostream>

#include "litags/client/client.h"
#include "litags/client/connection.h"

absl::Status ListJobs(const char* server) {
  const auto channel = litags::client::Connect({.server = server});
  if (!channel.ok()) return channel.status();
  litags::client::Interrupt interrupt;
  litags::client::Client client(*channel, {}, interrupt);
  const auto answer = client.ListJobs({});
  if (!answer.ok()) return answer.status();
  for (const litags::v1::Job& job : answer->jobs()) std::cout << job.name() << "\n";
  return absl::OkStatus();
}

int main(int argc, char** argv) {
  const absl::Status status = ListJobs(argc > 1 ? argv[1] : "127.0.0.1:50051");
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
