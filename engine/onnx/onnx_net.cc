#include "engine/onnx/onnx_net.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/onnx/divisors.h"

namespace litags {

struct OnnxNet::Impl {
  cv::dnn::Net net;
  std::string path, field;
};

namespace {

constexpr int kMaxSide = 8192;
constexpr int64_t kMaxFileBytes = int64_t{2000} << 20;  // Protobuf's own limit is 2 GiB

// OpenCV's what() spans lines and repeats the source position; one line of it is enough.
std::string FirstLine(const cv::Exception& e) {
  return e.err.substr(0, std::min(e.err.find('\n'), size_t{300}));
}

absl::Status Bad(std::string_view reason, const std::string& field, const std::string& path,
                 const std::string& what) {
  return InvalidInput(reason, field, absl::StrCat(field, ": ", path, ": ", what));
}

// The tensor as planes; see OnnxNet::Run.
absl::StatusOr<Planes> ToPlanes(const cv::Mat& blob, const std::string& field,
                                const std::string& path) {
  std::vector<int> shape(blob.size.p, blob.size.p + blob.dims);
  const std::string text = absl::StrCat("output of ", shape.size(), " dimensions");
  while (shape.size() > 3 && shape.front() == 1) shape.erase(shape.begin());
  if (shape.empty() || shape.size() > 3 || blob.type() != CV_32F || blob.total() == 0) {
    return Bad("ONNX_OUTPUT", field, path,
               absl::StrCat(text,
                            " is not one picture of floats; export a network that gives "
                            "[1, C, H, W]"));
  }
  while (shape.size() < 3) shape.insert(shape.begin(), 1);
  Planes planes(shape[0], shape[1], shape[2]);
  const cv::Mat flat = blob.isContinuous() ? blob : blob.clone();
  std::copy_n(flat.ptr<float>(), planes.data.size(), planes.data.begin());
  const bool finite =
      std::all_of(planes.data.begin(), planes.data.end(), [](float v) { return std::isfinite(v); });
  if (!finite) return Bad("ONNX_OUTPUT", field, path, "gives values that are not finite");
  return planes;
}

}  // namespace

OnnxNet::OnnxNet(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
OnnxNet::OnnxNet(OnnxNet&&) noexcept = default;
OnnxNet& OnnxNet::operator=(OnnxNet&&) noexcept = default;
OnnxNet::~OnnxNet() = default;

absl::StatusOr<OnnxNet> OnnxNet::Load(const std::string& path, std::string_view field) {
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->field = std::string(field);
  LITAGS_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path, field, kMaxFileBytes));
  if (!UnshareDivisors(&bytes)) {
    return Bad("ONNX_UNREADABLE", impl->field, path, "is not an ONNX file");
  }
  try {
    impl->net = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
    impl->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    impl->net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  } catch (const cv::Exception& e) {
    return Bad("ONNX_UNREADABLE", impl->field, path,
               absl::StrCat("OpenCV cannot read it as ONNX (", FirstLine(e),
                            "); export with opset 11 and fixed sizes"));
  }
  if (impl->net.empty()) return Bad("ONNX_UNREADABLE", impl->field, path, "holds no network");
  return OnnxNet(std::move(impl));
}

absl::StatusOr<Planes> OnnxNet::Run(const std::vector<OnnxInput>& inputs,
                                    const std::string& output) {
  try {
    for (const OnnxInput& input : inputs) {
      const int shape[] = {1, input.planes.channels, input.planes.height, input.planes.width};
      // setInput copies.
      impl_->net.setInput(cv::Mat(4, shape, CV_32F, const_cast<float*>(input.planes.data.data())),
                          input.name);
    }
    return ToPlanes(impl_->net.forward(output), impl_->field, impl_->path);
  } catch (const cv::Exception& e) {
    return Bad("ONNX_RUN", impl_->field, impl_->path,
               absl::StrCat("cannot be run (", FirstLine(e),
                            "); check the names and sizes of its inputs"));
  }
}

bool ParsePerChannel(const std::string& text, std::array<double, 3>* values) {
  const std::vector<std::string> parts = absl::StrSplit(text, ':');
  if (parts.size() != 3) return false;
  for (size_t c = 0; c < 3; ++c) {
    if (!absl::SimpleAtod(parts[c], &(*values)[c]) || !std::isfinite((*values)[c])) return false;
  }
  return true;
}

absl::Status OnnxPhotoOptions::Validate(std::string_view field) const {
  const std::string name(field);
  if (width < 0 || width > kMaxSide || height < 0 || height > kMaxSide) {
    return InvalidInput("OUT_OF_RANGE", field,
                        absl::StrCat(name, ": size ", width, "x", height,
                                     " has a side outside 0..8192 (0: the photo's own)"));
  }
  if (multiple < 1 || multiple > 1024) {
    return InvalidInput("OUT_OF_RANGE", field,
                        absl::StrCat(name, ": multiple ", multiple, " is not in 1..1024"));
  }
  for (int c = 0; c < 3; ++c) {
    if (!std::isfinite(mean[c]) || !std::isfinite(std[c]) || std[c] <= 0) {
      return InvalidInput("OUT_OF_RANGE", field,
                          absl::StrCat(name, ": mean ", mean[c], " and std ", std[c],
                                       " must be finite, std above 0"));
    }
  }
  return absl::OkStatus();
}

Planes OnnxPhoto(const ImageU8& photo, const OnnxPhotoOptions& options) {
  const auto side = [&](int wanted, int own) {
    const int size = wanted > 0 ? wanted : own;
    return (size + options.multiple - 1) / options.multiple * options.multiple;
  };
  const int width = side(options.width, photo.width), height = side(options.height, photo.height);
  const bool fits = width == photo.width && height == photo.height;
  Planes planes = ToPlanes(fits ? photo : ResizeArea(photo, width, height));
  for (int c = 0; c < 3; ++c) {
    const float mean = static_cast<float>(options.mean[c]);
    const float scale = static_cast<float>(1.0 / options.std[c]);
    float* plane = planes.plane(c);
    for (size_t i = 0; i < planes.plane_size(); ++i) plane[i] = (plane[i] - mean) * scale;
  }
  return planes;
}

}  // namespace litags
