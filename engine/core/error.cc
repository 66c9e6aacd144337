#include "engine/core/error.h"

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"

namespace litags {
namespace {
constexpr char kPayloadUrl[] = "litags/error-detail";
}

absl::Status MakeError(absl::StatusCode code, std::string_view reason, std::string_view field,
                       std::string_view message) {
  absl::Status status(code, absl::string_view(message.data(), message.size()));
  // Field last, so that it may hold any character but the separator in front of it.
  status.SetPayload(kPayloadUrl,
                    absl::Cord(absl::StrCat(std::string(reason), "\n", std::string(field))));
  return status;
}

std::optional<ErrorDetail> GetErrorDetail(const absl::Status& status) {
  auto payload = status.GetPayload(kPayloadUrl);
  if (!payload.has_value()) return std::nullopt;
  std::string text(*payload);
  size_t cut = text.find('\n');
  return ErrorDetail{text.substr(0, cut), text.substr(cut + 1)};
}

}  // namespace litags
