#include "engine/pipeline/exception_status.h"

#include <exception>
#include <new>
#include <opencv2/core.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

absl::Status OutOfMemory() {
  return MakeError(absl::StatusCode::kResourceExhausted, "MEMORY_EXCEEDED", "",
                   "the engine found no more memory; set max_image_side, max_gaussians or threads "
                   "lower, or give it more");
}

absl::Status Unexpected(const char* what) {
  return absl::InternalError(absl::StrCat("the engine failed: ", what));
}

}  // namespace

absl::Status StatusOfException() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return OutOfMemory();
  } catch (const cv::Exception& e) {
    return e.code == cv::Error::StsNoMem ? OutOfMemory() : Unexpected(e.what());
  } catch (const std::exception& e) {
    return Unexpected(e.what());
  } catch (...) {
    return Unexpected("an exception of unknown kind");
  }
}

}  // namespace litags
