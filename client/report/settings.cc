#include "client/report/settings.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/report/text.h"
#include "litags/v1/help.pb.h"

namespace litags::report {
namespace {

using google::protobuf::FieldDescriptor;

struct Setting {
  std::string name;  // as on the command line: "max-gaussians"
  std::string value, usual;
  std::string help;
  bool is_flag;  // takes its value behind an equals sign
  bool IsChanged() const { return value != usual; }
};

// In the fewest digits that mean this number and no other.
std::string Shortest(double number) {
  char text[32];
  return {text, std::to_chars(std::begin(text), std::end(text), number).ptr};
}

// As the command line takes it.
std::string ValueOf(const v1::JobOptions& options, const FieldDescriptor& field) {
  const auto& reflection = *options.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_ENUM:
      return EnumWord(*reflection.GetEnum(options, &field));
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.GetBool(options, &field) ? "true" : "false";
    case FieldDescriptor::CPPTYPE_INT32:
      return absl::StrCat(reflection.GetInt32(options, &field));
    case FieldDescriptor::CPPTYPE_INT64:
      return absl::StrCat(reflection.GetInt64(options, &field));
    case FieldDescriptor::CPPTYPE_UINT64:
      return absl::StrCat(reflection.GetUInt64(options, &field));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return Shortest(reflection.GetDouble(options, &field));
    default:
      return "";
  }
}

std::vector<Setting> SettingsOf(const v1::JobOptions& options, const v1::ServerInfo& server) {
  // What the server's version has, which need not be that of the job's run.
  v1::JobOptions defaults = options;
  for (const v1::MethodInfo& method : server.methods()) {
    if (method.method() == options.method()) defaults = method.defaults();
  }
  std::vector<Setting> settings;
  const auto& type = *v1::JobOptions::descriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    std::string name = field.name();
    std::replace(name.begin(), name.end(), '_', '-');
    settings.push_back({std::move(name), ValueOf(options, field), ValueOf(defaults, field),
                        field.options().GetExtension(v1::help),
                        field.cpp_type() == FieldDescriptor::CPPTYPE_BOOL});
  }
  return settings;
}

}  // namespace

std::string OptionText(const v1::JobOptions& options, const std::string& name) {
  const FieldDescriptor* field = v1::JobOptions::descriptor()->FindFieldByName(name);
  return field == nullptr ? "" : ValueOf(options, *field);
}

Html SettingsSection(const v1::JobOptions& options, const v1::ServerInfo& server) {
  Html rows;
  std::string command = "litags submit PHOTOS";
  for (const Setting& setting : SettingsOf(options, server)) {
    const bool is_method = setting.name == "method";
    if (is_method || setting.IsChanged()) {
      absl::StrAppend(&command, " --", setting.name, setting.is_flag ? "=" : " ", setting.value);
    }
    rows += El("tr", {{"class", setting.IsChanged() ? "changed" : "usual"}},
               {El("th", {{"scope", "row"}}, {setting.name}), El("td", {}, {setting.value}),
                El("td", {}, {setting.IsChanged() ? setting.usual : ""}),
                El("td", {{"class", "help"}}, {setting.help})});
  }
  const Html head =
      El("tr", {},
         {El("th", {{"scope", "col"}}, {"Option"}), El("th", {{"scope", "col"}}, {"Value"}),
          El("th", {{"scope", "col"}}, {"Default, if another"}),
          El("th", {{"scope", "col"}, {"class", "help"}}, {"Meaning"})});
  return El(
      "section", {},
      {El("h2", {}, {"Settings"}),
       El("p", {},
          {"The same files (photos, and cameras, masks and depth maps if there were any), "
           "options and seed give the same scene:"}),
       El("pre", {}, {command}),
       El("table", {{"class", "settings"}}, {El("thead", {}, {head}), El("tbody", {}, {rows})})});
}

}  // namespace litags::report
