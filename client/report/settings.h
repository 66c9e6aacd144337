#ifndef LITAGS_CLIENT_REPORT_SETTINGS_H_
#define LITAGS_CLIENT_REPORT_SETTINGS_H_

#include <string>

#include "client/report/html.h"
#include "litags/v1/reconstruction_service.pb.h"

namespace litags::report {

// The value of the option of that name, "max_gaussians", as the command line takes it; empty if
// this version has no such option.
std::string OptionText(const v1::JobOptions& options, const std::string& name);

// Every option that was in force, those marked that differ from the method's defaults, and the
// command that takes the same ones.
Html SettingsSection(const v1::JobOptions& options, const v1::ServerInfo& server);

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_SETTINGS_H_
