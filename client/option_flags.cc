#include "client/option_flags.h"

#include <google/protobuf/descriptor.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "client/report/text.h"
#include "client/status.h"
#include "litags/v1/help.pb.h"
#include "proto/arguments/arguments.h"

namespace litags::client {
namespace {

using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Reflection;

std::string Dashed(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

void SetEnum(const FieldDescriptor& field, const std::string& word, v1::JobOptions& options) {
  std::string words;
  const EnumDescriptor& type = *field.enum_type();
  for (int i = 1; i < type.value_count(); ++i) {  // not UNSPECIFIED
    const std::string known = report::EnumWord(*type.value(i));
    if (word == known) return options.GetReflection()->SetEnum(&options, &field, type.value(i));
    absl::StrAppend(&words, words.empty() ? "" : ", ", known);
  }
  throw CLI::ValidationError(Dashed(absl::StrCat("--", field.name())),
                             absl::StrCat("\"", word, "\" is not one of: ", words));
}

CLI::Option* AddFlag(CLI::App& command, const FieldDescriptor& field, v1::JobOptions& options) {
  const std::string flag = Dashed(absl::StrCat("--", field.name()));
  const Reflection& reflection = *options.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_ENUM:
      return command.add_option_function<std::string>(
          flag, [&](const std::string& word) { SetEnum(field, word, options); });
    case FieldDescriptor::CPPTYPE_BOOL:
      return command
          .add_option(flag,
                      [&](const CLI::results_t& words) {  // add_flag_function aborts at "=x"
                        bool on = false;
                        const bool known = CLI::detail::lexical_cast(words.back(), on);
                        if (known) reflection.SetBool(&options, &field, on);
                        return known;
                      })
          ->expected(0)
          ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    case FieldDescriptor::CPPTYPE_INT32:
      return command.add_option_function<int32_t>(
          flag, [&](int32_t value) { reflection.SetInt32(&options, &field, value); });
    case FieldDescriptor::CPPTYPE_INT64:
      return command.add_option_function<int64_t>(
          flag, [&](int64_t value) { reflection.SetInt64(&options, &field, value); });
    case FieldDescriptor::CPPTYPE_UINT64:
      return command
          .add_option_function<uint64_t>(
              flag, [&](uint64_t value) { reflection.SetUInt64(&options, &field, value); })
          ->check(AtLeastZero(uint64_t{}));  // CLI11 would make -1 the largest number
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return command.add_option_function<double>(
          flag, [&](double value) { reflection.SetDouble(&options, &field, value); });
    default:
      throw CLI::ConstructionError(absl::StrCat(flag, " has a type that is no option's"),
                                   CLI::ExitCodes::IncorrectConstruction);
  }
}

}  // namespace

void AddOptionFlags(CLI::App& command, v1::JobOptions& options, const std::string& group,
                    const std::set<std::string>& names) {
  const auto& fields = *v1::JobOptions::descriptor();
  for (int i = 0; i < fields.field_count(); ++i) {
    const FieldDescriptor& field = *fields.field(i);
    if (!names.empty() && !names.contains(field.name())) continue;
    AddFlag(command, field, options)
        ->description(field.options().GetExtension(v1::help))
        ->group(group);
  }
}

absl::Status CheckMethodUses(const v1::JobOptions& options) {
  const bool asks = options.depth_source() == v1::DEPTH_SOURCE_MAPS ||
                    options.depth_source() == v1::DEPTH_SOURCE_STEREO ||
                    options.depth_source() == v1::DEPTH_SOURCE_NETWORK;
  if (asks && options.method() == v1::METHOD_3DGS) {
    return BadInput("OPTION_UNUSED", "--depth-source",
                    "--depth-source would not be used: the method has no depth loss; leave it out, "
                    "or take another method than 3dgs");
  }
  const bool others_tone =
      options.method() == v1::METHOD_3DGS || options.method() == v1::METHOD_LITAGS_PAPER;
  const bool balances =
      options.tone() == v1::TONE_UNSPECIFIED ? !others_tone : options.tone() == v1::TONE_CAPTURE;
  if (!balances && options.white_balance() != v1::WHITE_BALANCE_UNSPECIFIED) {
    return BadInput("OPTION_UNUSED", "--white-balance",
                    "--white-balance would not be used: only the tone capture balances colours; "
                    "leave it out, or give --tone capture");
  }
  return absl::OkStatus();
}

absl::Status CheckFramesAreOfVideo(const v1::JobOptions& options, bool is_video) {
  if (is_video || options.frames() == 0) return absl::OkStatus();
  return BadInput("OPTION_UNUSED", "--frames",
                  "--frames is for videos, and these are photos; leave it out");
}

}  // namespace litags::client
