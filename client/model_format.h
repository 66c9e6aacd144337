// Scene formats and axes by the words of the command line: those of the protocol's enums.
#ifndef LITAGS_CLIENT_MODEL_FORMAT_H_
#define LITAGS_CLIENT_MODEL_FORMAT_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "litags/v1/model_service.pb.h"

namespace litags::client {

// "ply", "ply-full", "spz", ...; MODEL_FORMAT_SPZ_V4 is "spz-v4".
std::vector<std::string> ModelFormatNames();

// INVALID_ARGUMENT (MODEL_FORMAT_UNKNOWN) for other words.
absl::StatusOr<v1::ModelFormat> ParseModelFormat(const std::string& name);

// How a file of the format is named: .ply, .compressed.ply, .spz, .sog, .splat, .glb, .usda, .zip
// for COLMAP, .points.ply, .las, .mesh.ply, .mesh.glb, .litags. INVALID_ARGUMENT
// (MODEL_FORMAT_UNKNOWN) for others.
absl::StatusOr<v1::ModelFormat> ModelFormatOf(const std::string& path);
// INVALID_ARGUMENT (MODEL_FORMAT_CONFLICT) if the path ends as files of another format do.
absl::Status CheckEnding(const std::string& path, v1::ModelFormat format);

// What ExportHeader counts of the format: "Gaussians", "points" or "triangles".
const char* ContentOf(v1::ModelFormat format);

// "x", "-x", ..., "keep". INVALID_ARGUMENT (UP_AXIS_UNKNOWN) for other words.
absl::StatusOr<v1::UpAxis> ParseUpAxis(const std::string& name);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_MODEL_FORMAT_H_
