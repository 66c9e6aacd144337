#include "engine/io/ply.h"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

constexpr int kNoRow = -1;  // a property of the file that is no row of ours
constexpr int kMaxRest = 45;
constexpr size_t kMaxHeaderBytes = 64 << 10;

struct Property {
  std::string name;
  int row;
};

// f_rest_i of a file with `per_channel` coefficients per colour: all of red, then green, then blue.
int RestRow(int i, int per_channel) {
  const int channel = i / per_channel, coefficient = i % per_channel;
  return kShRest + 3 * coefficient + channel;
}

void AddRows(std::vector<Property>* out, const std::string& stem, int first_row, int count) {
  for (int i = 0; i < count; ++i) out->push_back({absl::StrCat(stem, i), first_row + i});
}

// What every file has, in the order viewers expect.
std::vector<Property> BaseProperties(int num_rest) {
  std::vector<Property> out = {{"x", kMean},   {"y", kMean + 1}, {"z", kMean + 2},
                               {"nx", kNoRow}, {"ny", kNoRow},   {"nz", kNoRow}};
  AddRows(&out, "f_dc_", kShDc, 3);
  for (int i = 0; i < num_rest; ++i) {
    out.push_back({absl::StrCat("f_rest_", i), RestRow(i, num_rest / 3)});
  }
  out.push_back({"opacity", kLogitOpacity});
  AddRows(&out, "scale_", kLogScale, 3);
  AddRows(&out, "rot_", kRawQuat, 4);
  return out;
}

std::vector<Property> LitaProperties() {
  std::vector<Property> out = {{"structure", kStructure}, {"depth", kDepth}};
  AddRows(&out, "noise_", kNoise, 3);
  AddRows(&out, "illumination_", kIllumination, 3);
  return out;
}

// A scalar property of the file: where in the record, and of which type.
struct Column {
  std::string name;
  size_t offset;
  bool is_double;
  bool is_real;  // float or double
};

struct Header {
  int64_t count = 0;       // Gaussians
  size_t record_size = 0;  // bytes per Gaussian
  size_t data_offset = 0;
  std::vector<Column> columns;
};

// Bytes of a PLY scalar type, 0 for an unknown one.
size_t TypeSize(std::string_view type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "int" || type == "uint" || type == "int32" || type == "uint32") return 4;
  if (type == "float" || type == "float32") return 4;
  return type == "double" || type == "float64" ? 8 : 0;
}

absl::Status Unsupported(std::string_view field, std::string_view what) {
  return InvalidField(
      "PLY_UNSUPPORTED", field,
      absl::StrCat(Absl(what), "; export a standard binary little-endian 3D Gaussian .ply"));
}

// Adds "property <type> <name>" of the vertex element.
absl::Status AddColumn(const std::vector<std::string>& words, std::string_view field,
                       Header* header) {
  if (words.size() != 3 || TypeSize(words[1]) == 0) {
    return Unsupported(field, absl::StrCat("property '", words.back(), "' is not one number"));
  }
  for (const Column& column : header->columns) {
    if (column.name == words[2]) {
      return Unsupported(field, absl::StrCat("property '", words[2], "' occurs twice"));
    }
  }
  const size_t size = TypeSize(words[1]);
  const bool is_double = size == 8;
  const bool is_real = is_double || words[1].starts_with("float");
  header->columns.push_back({words[2], header->record_size, is_double, is_real});
  header->record_size += size;
  return absl::OkStatus();
}

absl::StatusOr<Header> ParseHeader(std::string_view bytes, std::string_view field) {
  if (!bytes.starts_with("ply\n") && !bytes.starts_with("ply\r\n")) {
    return InvalidField("NOT_A_PLY", field, "not a PLY file");
  }
  Header header;
  bool binary = false, in_vertex = false, seen_element = false;
  size_t position = 0;
  while (true) {
    const size_t end = bytes.substr(0, kMaxHeaderBytes).find('\n', position);
    if (end == std::string_view::npos) {
      return InvalidField("PLY_TRUNCATED", field, "the header has no end; send the whole file");
    }
    const std::vector<std::string> words = absl::StrSplit(
        Absl(bytes.substr(position, end - position)), absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    position = end + 1;
    if (words.empty()) continue;
    if (words[0] == "end_header") break;
    if (words[0] == "format") {
      binary = words.size() == 3 && words[1] == "binary_little_endian";
    } else if (words[0] == "element") {
      in_vertex = !seen_element;
      if (in_vertex && (words.size() != 3 || words[1] != "vertex" ||
                        !absl::SimpleAtoi(words[2], &header.count) || header.count < 0)) {
        return Unsupported(field, "the first element is not 'vertex' with a count");
      }
      seen_element = true;
    } else if (words[0] == "property" && in_vertex) {
      LITAGS_RETURN_IF_ERROR(AddColumn(words, field, &header));
    }
  }
  if (!binary) return Unsupported(field, "the file is not binary little-endian");
  if (!seen_element) return Unsupported(field, "the file has no vertices");
  header.data_offset = position;
  return header;
}

const Column* FindColumn(const Header& header, std::string_view name) {
  for (const Column& column : header.columns) {
    if (column.name == name) return &column;
  }
  return nullptr;
}

// Where a row's value lies in a record.
struct RowSource {
  int row;
  size_t offset;
  bool is_double;
};

// Finds all of `properties`; names the first one that is missing or is no real number.
absl::Status FindRows(const Header& header, const std::vector<Property>& properties,
                      std::string_view field, std::vector<RowSource>* sources) {
  for (const Property& property : properties) {
    if (property.row == kNoRow) continue;
    const Column* column = FindColumn(header, property.name);
    if (column == nullptr || !column->is_real) {
      return Unsupported(field, absl::StrCat("there is no float property '", property.name, "'"));
    }
    sources->push_back({property.row, column->offset, column->is_double});
  }
  return absl::OkStatus();
}

// Degree of a file with `num_rest` f_rest properties, nullopt if the number fits none.
std::optional<int> DegreeFromRest(int num_rest) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    if (num_rest == 3 * ((degree + 1) * (degree + 1) - 1)) return degree;
  }
  return std::nullopt;
}

absl::Status ReadRecords(std::string_view data, const Header& header,
                         const std::vector<RowSource>& sources, std::string_view field,
                         Splats* splats) {
  for (size_t i = 0; i < splats->size(); ++i) {
    const char* record = data.data() + i * header.record_size;
    for (const RowSource& source : sources) {
      float value;
      if (source.is_double) {
        double wide;
        std::memcpy(&wide, record + source.offset, sizeof(wide));
        value = static_cast<float>(wide);
      } else {
        std::memcpy(&value, record + source.offset, sizeof(value));
      }
      if (!std::isfinite(value)) {
        return InvalidField("NOT_FINITE", field,
                            absl::StrCat("Gaussian ", i, " holds NaN or infinity"));
      }
      splats->at(i, source.row) = value;
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::string EncodePly(const Splats& splats, bool lita_attributes,
                      const std::array<double, 3>& origin) {
  std::vector<Property> properties = BaseProperties(kMaxRest);
  if (lita_attributes) {
    for (Property& property : LitaProperties()) properties.push_back(std::move(property));
  }
  std::string out = "ply\nformat binary_little_endian 1.0\n";
  if (origin != std::array<double, 3>{}) {
    absl::StrAppendFormat(&out, "comment origin %.17g %.17g %.17g\n", origin[0], origin[1],
                          origin[2]);
  }
  absl::StrAppend(&out, "element vertex ", splats.size(), "\n");
  for (const Property& property : properties) {
    absl::StrAppend(&out, "property float ", property.name, "\n");
  }
  out += "end_header\n";
  const size_t header_size = out.size();
  out.resize(header_size + splats.size() * properties.size() * sizeof(float));
  char* to = out.data() + header_size;
  for (size_t i = 0; i < splats.size(); ++i) {
    for (const Property& property : properties) {
      const float value = property.row == kNoRow ? 0.0f : splats.at(i, property.row);
      std::memcpy(to, &value, sizeof(value));
      to += sizeof(value);
    }
  }
  return out;
}

absl::Status WritePly(const std::string& path, const Splats& splats, bool lita_attributes,
                      const std::array<double, 3>& origin) {
  return WriteFileAtomically(path, EncodePly(splats, lita_attributes, origin));
}

absl::StatusOr<PlyScene> DecodePly(std::string_view bytes, std::string_view field,
                                   int64_t max_gaussians) {
  LITAGS_ASSIGN_OR_RETURN(const Header header, ParseHeader(bytes, field));
  if (header.count > max_gaussians) {
    return InvalidField(
        "PLY_TOO_LARGE", field,
        absl::StrCat(header.count, " Gaussians exceed the limit of ", max_gaussians));
  }
  int num_rest = 0;
  for (const Column& column : header.columns) num_rest += column.name.starts_with("f_rest_");
  const std::optional<int> degree = DegreeFromRest(num_rest);
  if (!degree.has_value()) {
    return Unsupported(field,
                       absl::StrCat(num_rest, " f_rest properties; 0, 9, 24 or 45 are known"));
  }
  std::vector<RowSource> sources;
  LITAGS_RETURN_IF_ERROR(FindRows(header, BaseProperties(num_rest), field, &sources));

  PlyScene scene;
  scene.sh_degree = *degree;
  scene.lita_attributes =
      FindColumn(header, "structure") != nullptr && FindColumn(header, "illumination_0") != nullptr;
  if (scene.lita_attributes) {
    LITAGS_RETURN_IF_ERROR(FindRows(header, LitaProperties(), field, &sources));
  }
  const std::string_view data = bytes.substr(header.data_offset);
  if (static_cast<uint64_t>(header.count) > data.size() / header.record_size) {
    return InvalidField("PLY_TRUNCATED", field,
                        absl::StrCat("the header promises ", header.count,
                                     " Gaussians, the file is too short for them; send all of it"));
  }
  scene.splats.Resize(static_cast<size_t>(header.count));
  LITAGS_RETURN_IF_ERROR(ReadRecords(data, header, sources, field, &scene.splats));
  return scene;
}

}  // namespace litags
