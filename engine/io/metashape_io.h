// Cameras of Agisoft Metashape: the XML file of File > Export > Export Cameras.
#ifndef LITAGS_ENGINE_IO_METASHAPE_IO_H_
#define LITAGS_ENGINE_IO_METASHAPE_IO_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

// Any XML: what else it is, its reader says.
bool IsXml(std::string_view text);

// The cameras that are enabled and have a pose; of several components those of the one that has
// most. Lenses ("Camera models" in Metashape's manual): frame without k4 and b2, fisheye without
// tangential terms, and spherical with `panoramas`; others are refused by name
// (UNSUPPORTED_CAMERA_MODEL), as systems of several cameras are. INVALID_ARGUMENT naming field and
// camera; BAD_XML.
absl::StatusOr<SparseModel> ParseMetashape(std::string_view xml, std::string_view field,
                                           PanoramaNames* panoramas = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_METASHAPE_IO_H_
