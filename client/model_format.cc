#include "client/model_format.h"

#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "client/status.h"

namespace litags::client {
namespace {

// "MODEL_FORMAT_SPZ_V4" -> "spz-v4".
std::string Word(const std::string& value) {
  return absl::AsciiStrToLower(
      absl::StrReplaceAll(value.substr(sizeof("MODEL_FORMAT_") - 1), {{"_", "-"}}));
}

constexpr std::pair<const char*, v1::ModelFormat> kEndings[] = {
    {".compressed.ply", v1::MODEL_FORMAT_COMPRESSED_PLY},
    {".points.ply", v1::MODEL_FORMAT_POINTS},
    {".mesh.ply", v1::MODEL_FORMAT_MESH_PLY},
    {".mesh.glb", v1::MODEL_FORMAT_MESH_GLB},
    {".ply", v1::MODEL_FORMAT_PLY},
    {".spz", v1::MODEL_FORMAT_SPZ},
    {".sog", v1::MODEL_FORMAT_SOG},
    {".splat", v1::MODEL_FORMAT_SPLAT},
    {".glb", v1::MODEL_FORMAT_GLB},
    {".usda", v1::MODEL_FORMAT_USDA},
    {".zip", v1::MODEL_FORMAT_COLMAP},
    {".html", v1::MODEL_FORMAT_HTML},
    {".las", v1::MODEL_FORMAT_LAS},
    {".litags", v1::MODEL_FORMAT_LITAGS},
};

constexpr std::pair<const char*, v1::UpAxis> kAxes[] = {
    {"x", v1::UP_AXIS_X},           {"-x", v1::UP_AXIS_NEGATIVE_X}, {"y", v1::UP_AXIS_Y},
    {"-y", v1::UP_AXIS_NEGATIVE_Y}, {"z", v1::UP_AXIS_Z},           {"-z", v1::UP_AXIS_NEGATIVE_Z},
    {"keep", v1::UP_AXIS_KEEP},
};

}  // namespace

std::vector<std::string> ModelFormatNames() {
  std::vector<std::string> names;
  const auto* values = v1::ModelFormat_descriptor();
  for (int i = 0; i < values->value_count(); ++i) {
    if (values->value(i)->number() != v1::MODEL_FORMAT_UNSPECIFIED) {
      names.push_back(Word(values->value(i)->name()));
    }
  }
  return names;
}

absl::StatusOr<v1::ModelFormat> ParseModelFormat(const std::string& name) {
  v1::ModelFormat format;
  const std::string value = absl::AsciiStrToUpper(absl::StrReplaceAll(name, {{"-", "_"}}));
  if (v1::ModelFormat_Parse("MODEL_FORMAT_" + value, &format) &&
      format != v1::MODEL_FORMAT_UNSPECIFIED) {
    return format;
  }
  return BadInput("MODEL_FORMAT_UNKNOWN", "--format",
                  absl::StrCat("--format: \"", name, "\" is none of ",
                               absl::StrJoin(ModelFormatNames(), ", ")));
}

absl::StatusOr<v1::ModelFormat> ModelFormatOf(const std::string& path) {
  std::vector<std::string> known;
  for (const auto& [ending, format] : kEndings) {
    if (absl::EndsWithIgnoreCase(path, ending)) return format;
    known.push_back(ending);
  }
  return BadInput("MODEL_FORMAT_UNKNOWN", "-o",
                  absl::StrCat("-o: ", path, " ends with none of ", absl::StrJoin(known, ", "),
                               "; rename it, or give --format"));
}

absl::Status CheckEnding(const std::string& path, v1::ModelFormat format) {
  const std::string word = Word(v1::ModelFormat_Name(format));
  std::string right = absl::StrCat(".", word.substr(0, word.find('-')));  // ply-full, spz-v4
  std::string given;
  for (const auto& [ending, of] : kEndings) {
    const std::string last(std::strrchr(ending, '.'));
    if (of == format) right = last;
    // The longest: x.points.ply is no .ply of Gaussians.
    if (given.empty() && absl::EndsWithIgnoreCase(path, ending)) {
      given = of == format ? last : ending;
    }
  }
  if (given.empty() || given == right) return absl::OkStatus();
  const std::string better = path.substr(0, path.size() - given.size()) + right;
  return BadInput("MODEL_FORMAT_CONFLICT", "-o",
                  absl::StrCat(path, ": what is asked for is ", word, ", not ", given, "; call it ",
                               better, ", or leave --format out"));
}

const char* ContentOf(v1::ModelFormat format) {
  switch (format) {
    case v1::MODEL_FORMAT_POINTS:
    case v1::MODEL_FORMAT_LAS:
      return "points";
    case v1::MODEL_FORMAT_MESH_PLY:
    case v1::MODEL_FORMAT_MESH_GLB:
      return "triangles";
    default:
      return "Gaussians";
  }
}

absl::StatusOr<v1::UpAxis> ParseUpAxis(const std::string& name) {
  for (const auto& [word, axis] : kAxes) {
    if (name == word) return axis;
  }
  return BadInput("UP_AXIS_UNKNOWN", "--up",
                  absl::StrCat("--up: \"", name, "\" is none of x, -x, y, -y, z, -z, keep"));
}

}  // namespace litags::client
