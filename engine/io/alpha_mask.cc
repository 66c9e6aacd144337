#include "engine/io/alpha_mask.h"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "engine/core/mask.h"
#include "engine/io/image_io.h"

namespace litags {

PlaneU8 AlphaMask(std::string_view bytes, int orientation) {
  if (!bytes.starts_with("\x89PNG")) return {};
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          const_cast<char*>(bytes.data()));
    const cv::Mat picture = cv::imdecode(encoded, cv::IMREAD_UNCHANGED);
    if (picture.channels() != 4) return {};
    cv::Mat alpha;
    cv::extractChannel(picture, alpha, 3);
    const double opaque = alpha.depth() == CV_16U ? 65535 : 255;
    PlaneU8 mask(alpha.cols, alpha.rows);
    const cv::Mat counts(alpha.rows, alpha.cols, CV_8U, mask.data.data());
    cv::compare(alpha, opaque / 2, counts, cv::CMP_GE);  // 255 where it is so: kCounts
    const size_t counted = CountedPixels(mask, mask.data.size());
    if (counted == 0 || counted == mask.data.size()) return {};
    return TurnUpright(mask, orientation);
  } catch (const cv::Exception&) {
    return {};
  }
}

}  // namespace litags
